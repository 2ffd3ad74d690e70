"""Projections onto the rules of a scene: bounds, lists, stock, length."""
