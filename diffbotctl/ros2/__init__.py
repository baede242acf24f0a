"""The bridge to ROS 2: a process beside the engine that is a client of its control socket."""
