"""Jobs that find out what a robot's dimensions and motors really are."""
