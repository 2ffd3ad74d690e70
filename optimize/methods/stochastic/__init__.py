"""Methods that draw."""
