"""Virtual boards: the firmware binary in an emulated microcontroller."""
