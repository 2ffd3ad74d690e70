"""Scenes as TOML files: reading, ranges and JSON Schema."""
