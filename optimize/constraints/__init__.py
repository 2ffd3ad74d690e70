"""Projections onto the rules of a scene: bounds, stock, length."""
