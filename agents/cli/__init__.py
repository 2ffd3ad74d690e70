"""The commands `domino train` and `domino evaluate`."""
