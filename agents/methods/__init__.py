"""Agents as methods of a search."""
