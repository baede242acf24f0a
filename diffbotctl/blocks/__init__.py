"""Built-in blocks: one file, one block."""
