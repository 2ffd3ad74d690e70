"""Scenes as problems of other frameworks."""
