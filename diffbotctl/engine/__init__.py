"""The only place where time passes: the loop, its clocks, the last gate, recording and replay."""
