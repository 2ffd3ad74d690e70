"""Methods that ask for scores alone, and no chance."""
