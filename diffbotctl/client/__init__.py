"""Programs between the engine and other clients: connections, rules of driving, goals."""
