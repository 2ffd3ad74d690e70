"""`chain.wasm` run by wasmtime, with NumPy arrays as arguments."""

from __future__ import annotations

import ctypes
import functools
import math
from typing import Any

import numpy as np
import wasmtime
from wasmtime import _bindings as bindings

import domino_env as de
from domino_env.kernels import arrays
from optimize.studio.wasm.build import MATHS, MODULE

NO_FINALIZER = ctypes.CFUNCTYPE(None, ctypes.c_void_p)()


def unchecked(name: str) -> Any:
    """Return a function of `math` for the module, ten times as fast as one with checked types."""
    function, count = getattr(math, name), 2 if name == "atan2" else 1

    def call(_data: int, _caller: Any, values: Any, _length: int) -> int:
        values[0].f64 = function(*(values[k].f64 for k in range(count)))
        return 0  # no error

    return bindings.wasmtime_func_unchecked_callback_t(call)


class Chain:
    """The module; arrays are copied to its memory and back."""

    def __init__(self) -> None:
        engine = wasmtime.Engine()
        self.store, linker = wasmtime.Store(engine), wasmtime.Linker(engine)
        number = wasmtime.ValType.f64()
        self.maths = [unchecked(name) for name in MATHS]  # kept alive
        for name, function in zip(MATHS, self.maths, strict=True):
            kind = wasmtime.FuncType([number] * (2 if name == "atan2" else 1), [number])
            names = b"env", 3, name.encode(), len(name)
            bindings.wasmtime_linker_define_func_unchecked(
                linker.ptr(), *names, kind.ptr(), function, None, NO_FINALIZER
            )
        module = wasmtime.Module(engine, MODULE.read_bytes())
        self.exports = linker.instantiate(self.store, module).exports(self.store)

    def call(self, name: str, *arguments: Any) -> int:
        """Call a function; arrays among the arguments are written by it."""
        self.exports["rewind"](self.store, 0)
        places = [
            self.exports["take"](self.store, max(a.nbytes, 1)) if isinstance(a, np.ndarray) else a
            for a in arguments
        ]
        pairs = [(a, at) for a, at in zip(arguments, places, strict=True) if a is not at]
        for array, at in pairs:
            ctypes.memmove(self._address + at, array.ctypes.data, array.nbytes)
        result = self.exports[f"run_{name}"](self.store, *places)
        for array, at in pairs:
            ctypes.memmove(array.ctypes.data, self._address + at, array.nbytes)
        return int(result)

    @property
    def _address(self) -> int:
        return ctypes.addressof(self.exports["memory"].data_ptr(self.store).contents)

    def simulate(
        self, layout: de.Layout, physics: de.Physics, rtol: float = 1e-8, events: int = 0
    ) -> tuple[Any, Any, Any]:
        """Return summary, arrivals and tape."""
        summary, tape = np.zeros(1, arrays.SUMMARY), np.zeros(events, arrays.EVENT)
        arrivals = np.zeros(layout.count, arrays.ARRIVAL)
        parts = layout.count, int(not layout.is_flat), table(layout), setting(physics, rtol)
        self.call("simulate", *parts, 1, arrivals, summary, tape, events)
        return arrays.Summary._make(summary.item()), arrivals, tape

    def gradient(self, layout: de.Layout, physics: de.Physics, bar: Any) -> tuple[Any, Any]:
        """Return the derivatives by a table, and by friction, gravity and push."""
        summary, _, tape = self.simulate(layout, physics, events=40 * layout.count + 100)
        bars, by_physics = np.zeros((6, layout.count)), np.zeros(3)
        parts = layout.count, int(not layout.is_flat), table(layout), setting(physics)
        self.call("pullback", *parts, tape, summary.event_count, bar, bars, by_physics)
        return bars, by_physics


def table(layout: de.Layout) -> Any:
    """Return the rows of a layout."""
    rows = np.zeros((6, layout.count))
    names = "spacing", "thickness", "height", "density", "rise", "tilt"
    for row, name in zip(rows, names, strict=True):
        values = getattr(layout, name)
        row[: len(values)] = values
    return rows


def setting(physics: de.Physics, rtol: float = 1e-8) -> Any:
    """Return a setting of the kernels."""
    return np.array([physics.friction, physics.gravity, physics.push, rtol])


@functools.cache
def chain() -> Chain:
    """Return the module, which is loaded once."""
    return Chain()
