"""Child processes: forking, and the process that draws the screen."""
