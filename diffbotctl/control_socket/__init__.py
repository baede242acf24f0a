"""The control socket of a running engine: server, client and protocol."""
