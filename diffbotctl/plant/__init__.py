"""The physics of the simulated robot: exact between frames, seeded, no clock."""
