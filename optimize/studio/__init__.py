"""The page on which layouts are designed: one HTML file with the kernels as WebAssembly."""
