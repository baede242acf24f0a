"""What a shape cannot tell: wiring, pins, budgets and distances. One check a file."""
