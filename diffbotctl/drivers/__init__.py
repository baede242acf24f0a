"""Blocks at the edge that touch the world: links, the simulator, the operator."""
