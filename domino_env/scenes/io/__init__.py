"""Scenes as TOML files: reading and ranges."""
