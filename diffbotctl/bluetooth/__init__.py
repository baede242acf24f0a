"""The Bluetooth module of a robot: found, paired, spoken to, measured, set to another rate."""
