"""Questions to the person at the terminal, and files that answer them."""
