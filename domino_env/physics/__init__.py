"""Chains: layouts, physics, waves, their gradients, forces and motion."""
