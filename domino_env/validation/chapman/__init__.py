"""The figures and tables of Chapman's article, from our own numbers."""
