"""Gymnasium gets to know the environments, without being loaded for it.

`import domino_env` costs nothing; where Gymnasium is loaded already the environments are registered
at once, otherwise as soon as it is.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

ENVIRONMENTS = {
    "DominoChain-v0": ("domino_env.env:DominoChain", "domino_env.vector_env:DominoChainVector"),
    "DominoLayout-v0": ("domino_env.layout_env:DominoLayout", None),
}


def register() -> None:
    """Add the environments to Gymnasium's registry, once."""
    import gymnasium

    for name, (single, vector) in ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(id=name, entry_point=single, vector_entry_point=vector)


def register_with_gymnasium() -> None:
    """Register now if Gymnasium is loaded, else at the end of its loading."""
    loaded = sys.modules.get("gymnasium")
    if loaded is None:
        sys.meta_path.insert(0, _Lookout())
    elif hasattr(loaded, "register"):
        register()


class _Lookout(MetaPathFinder):
    """Waits for Gymnasium, and is gone once it has come."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name != "gymnasium":
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = _ThenRegister(spec.loader, self)
        return spec


class _ThenRegister(Loader):
    """Loads as the loader it stands for, then registers."""

    def __init__(self, loader: Loader, lookout: _Lookout) -> None:
        self._loader, self._lookout = loader, lookout

    def __getattr__(self, name: str) -> Any:
        return getattr(self._loader, name)

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        if module.__spec__ is not None:
            module.__spec__.loader = self._loader
        module.__loader__ = self._loader
        if self._lookout in sys.meta_path:
            sys.meta_path.remove(self._lookout)
        self._loader.exec_module(module)
        register()
