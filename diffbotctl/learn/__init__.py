"""Lessons that check themselves: a learner's folder, and runs that judge what is in it."""
