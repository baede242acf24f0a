"""Pictures: robot, wiring, map, as SVG or text."""
