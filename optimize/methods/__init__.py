"""Search methods, one file each, imported on demand: see `optimize.methods.registry`."""
