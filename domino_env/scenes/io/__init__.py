"""Scenes as TOML files: what they may say, read and written."""
