"""Arrays without reference counts, whose owner has to outlive them."""

from typing import Any

import numba
from numba.core import config

DISABLED = bool(getattr(config, "DISABLE_JIT"))  # noqa: B009 - not among its declared names

if DISABLED:

    def borrowed(array: Any) -> Any:
        """The array itself."""
        return array

else:

    @numba.extending.intrinsic
    def borrowed(_: Any, array: Any) -> Any:
        """The same array without its reference count, whose owner must outlive it.

        Counting is atomic, and was an eighth of a step's time.
        """

        def without_owner(context: Any, builder: Any, _: Any, args: Any) -> Any:
            view = context.make_array(array)(context, builder, args[0])
            view.meminfo = view.meminfo.type(None)
            return view._getvalue()

        return array(array), without_owner
