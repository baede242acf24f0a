"""The dashboard: a run on one screen, driven with keys and mouse."""
