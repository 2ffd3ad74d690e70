"""The commands of `optimize`, a module each."""
