"""The nearest values that keep a scene's rules: lists, stock, smoothness, length."""
