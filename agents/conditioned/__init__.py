"""Policies for many scenes: they read the scene and place a row at once."""
