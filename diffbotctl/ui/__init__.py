"""Screens: rich renderables made from what a run last said."""
