"""The old name of `domino validate` for rows PITCH=FREQUENCY, in millimetres and hits a second.

domino fit 16=64.4 24=42.3 32=28.1
"""

from __future__ import annotations

from domino_env.cli.validate import add_arguments, run

__all__ = ["SUMMARY", "add_arguments", "run"]

SUMMARY = "the old name of validate"
