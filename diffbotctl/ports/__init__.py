"""Serial ports of this machine: enumeration, permissions, programs that use them, problems."""
