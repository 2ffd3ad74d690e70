"""Search methods, one idea a file, loaded when asked for: see `optimize.methods.registry`."""
