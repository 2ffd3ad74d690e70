"""The policies that come with the package."""

from __future__ import annotations

from pathlib import Path

POLICIES = Path(__file__).parents[1] / "policies"
DESIGNER = "designer"  # the scene-conditioned one


def shipped() -> list[str]:
    """List the names of the policies for one scene that come with the package."""
    return sorted(folder.parent.name for folder in POLICIES.glob("*/scene.toml"))
