"""A row and how it falls: layouts, physics, waves, their gradients, forces and motion."""
