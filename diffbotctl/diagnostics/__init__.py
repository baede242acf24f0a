"""Checks of the installation, the ports and the Bluetooth radio."""
