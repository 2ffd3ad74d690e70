"""Values whose fields are computed when one of them is first read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Self


class Lazy:
    """Base of frozen dataclasses that may be computed later.

    A value that is not computed yet has the type and all attributes of one that is; fields with a
    default have this default. It is computed to be copied or pickled, too.
    """

    @classmethod
    def later(cls, compute: Callable[..., Self], *arguments: object) -> Self:
        """Return the value that a function returns, to be called when a field is first read."""
        value = object.__new__(cls)
        value.__dict__["_call"] = compute, arguments
        return value

    if not TYPE_CHECKING:  # to a type checker every attribute would exist

        def __getattr__(self, name: str) -> Any:
            # called for attributes that are missing only
            if name in (field.name for field in fields(self)) and name in self._computed():
                return self.__dict__[name]
            raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")

    def __getstate__(self) -> dict[str, Any]:
        return self._computed()

    def _computed(self) -> dict[str, Any]:
        """Return the attributes, with all fields."""
        attributes = self.__dict__
        if call := attributes.get("_call"):
            compute, arguments = call
            for name, value in compute(*arguments).__getstate__().items():
                attributes.setdefault(name, value)  # another thread may have computed it meanwhile
            attributes.pop("_call", None)  # last: where it is missing, all fields exist
        return attributes
