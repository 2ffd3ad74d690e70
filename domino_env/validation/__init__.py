"""Validation: accuracy, run times, Chapman's figures and tables, and measured chains."""
