"""Trials: many simulated runs of a pipeline, with faults, judged by what was expected."""
