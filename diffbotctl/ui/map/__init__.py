"""The map of a run in characters: canvas and camera, layers, trails."""
