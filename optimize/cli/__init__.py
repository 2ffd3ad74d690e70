"""Commands of `domino` for searches, one module each."""
