"""The engine: the loop, its clocks, the safety gate, live changes, event log and profiler."""
