"""The serial ports of this machine: what hangs on each, who may use it, what stands in the way."""
