"""Units of logical time: integer nanoseconds since the start of the run."""

MICROSECOND = 1_000  # ns
MILLISECOND = 1_000_000  # ns
SECOND = 1_000_000_000  # ns
NEVER = 2**62  # ns; later than any run (146 years), and the sum of two of them fits in 64 bits
