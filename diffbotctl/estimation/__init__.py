"""State estimation: wheel angles from encoder edges, pose from wheel travel."""
