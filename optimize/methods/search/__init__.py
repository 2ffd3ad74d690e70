"""Methods that use the structure of good layouts, such as the default `auto`, and CMA-ES."""
