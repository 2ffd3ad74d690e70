"""Datasets: scenes with the rows that search found for them, and episodes that build rows."""
