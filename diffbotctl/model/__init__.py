"""The robot as frames and solids, made from its file: URDF, frame tree and drawings."""
