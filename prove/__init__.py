"""The tables of figures that diffbotctl must show, each beside its target."""
