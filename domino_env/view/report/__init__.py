"""One page that plays rows against each other."""
