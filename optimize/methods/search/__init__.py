"""Methods that use the structure of good layouts, among them the default `auto`; CMA-ES."""
