"""The same rows in an independent rigid-body engine."""
