"""The dashboard: what a run says, on one screen, and a person's hands on it."""
