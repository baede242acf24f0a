"""A session with one board on a port: identify it, blink its light, report progress."""
