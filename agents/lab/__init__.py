"""Experiments: long trainings, presets that are searched for, ways to train that are compared."""
