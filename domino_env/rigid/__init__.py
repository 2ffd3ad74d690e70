"""Rigid bodies that keep no contact closed: simulator, third-party engine, verification."""
