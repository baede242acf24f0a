"""Codecs: bytes of a board in, messages out, and back. No I/O, no clock."""
