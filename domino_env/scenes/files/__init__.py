"""Scenes as TOML files: what they may say, read and written."""

from domino_env.scenes.files.reading import (
    load_scene,
    parse_scene,
    scene_names,
    scene_of_document,
)
from domino_env.scenes.files.writing import document_of, to_toml

__all__ = [
    "document_of",
    "load_scene",
    "parse_scene",
    "scene_names",
    "scene_of_document",
    "to_toml",
]
