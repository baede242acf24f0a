"""The guided path from nothing to a goal."""
