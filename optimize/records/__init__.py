"""The best layouts known of the scenes that ship, and who found them."""
