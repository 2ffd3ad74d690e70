"""Rows that people measured, a file a source, and the friction that explains them."""
