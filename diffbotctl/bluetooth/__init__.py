"""Bluetooth modules: scanning, pairing, link measurement, baud rate."""
