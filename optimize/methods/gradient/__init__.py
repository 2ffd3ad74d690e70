"""Methods that follow the exact gradient."""
