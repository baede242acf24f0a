"""The map: viewport, layers, canvas, trails."""
