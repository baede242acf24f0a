"""Model of the robot, derived from its file: frames, solids, URDF."""
