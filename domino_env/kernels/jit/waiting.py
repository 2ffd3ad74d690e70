"""Compilation takes seconds: the user is told, and of several processes one compiles for all."""

from __future__ import annotations

import contextlib
import gc
import logging
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, TextIO

from numba.core import event

from domino_env.core.progress import UNNOTICED, notice

if sys.platform != "win32":  # there each process compiles on its own
    import fcntl

LONGEST_TURN = 300.0  # [s] after which a process that compiles is assumed to be stopped
LOCK = "compiling.lock"

_thread = threading.local()


def announce(dispatcher: Any) -> None:
    """Make the compilation of a function that Python calls report itself."""
    compile_signature: Callable[..., Any] = dispatcher.compile

    def announced(signature: Any) -> Any:
        if getattr(_thread, "call", None) is not None:
            return compile_signature(signature)
        _thread.call = _FirstCall(dispatcher)
        try:
            with _few_collections, event.install_listener("numba:compile", _thread.call):
                return compile_signature(signature)
        finally:
            _thread.call.close()
            _thread.call = None

    dispatcher.compile = announced


def take_turn(folder: str) -> bool:
    """Wait until no other process compiles into a folder; return True if it may be filled since."""
    call = getattr(_thread, "call", None)
    return call is not None and call.take_turn(folder)


class _FewCollections:
    """Context with fewer garbage collections, which take 7 % of a compilation, in all threads."""

    def __init__(self) -> None:
        self.lock, self.number, self.thresholds = threading.Lock(), 0, gc.get_threshold()

    def __enter__(self) -> None:
        with self.lock:
            if not self.number:
                self.thresholds = gc.get_threshold()
                gc.set_threshold(self.thresholds[0] and 20_000, 20, 100)  # 0 stays off
            self.number += 1

    def __exit__(self, *_: object) -> None:
        with self.lock:
            self.number -= 1
            if not self.number:
                gc.set_threshold(*self.thresholds)


_few_collections = _FewCollections()


class _FirstCall(event.Listener):
    """First call of a function, during which functions below it are compiled."""

    def __init__(self, dispatcher: Any) -> None:
        self.name = dispatcher.py_func.__name__
        self.total = sum(not below.overloads for below in _functions_below(dispatcher))
        self.done, self.told, self.started = 0, False, time.monotonic()
        self.first = self.started  # time at which the first function was complete
        self.turn: TextIO | None = None

    def on_start(self, event: event.Event) -> None:
        """Do nothing: functions are counted when they are complete."""

    def on_end(self, event: event.Event) -> None:
        """Count a compiled function; tell the user if many remain."""
        self.done += event.data["dispatcher"].py_func.__module__.partition(".")[0] != "numba"
        now = time.monotonic()
        if self.done < 2:  # Numba has loaded its own functions before the first
            self.first = now
        elif now - self.started > UNNOTICED:
            rate = (now - self.first) / (self.done - 1)
            seconds = now - self.started + rate * max(self.total - self.done, 0)
            self.tell(f"compiling {self.name}, once: about {seconds:.0f} s here ...")

    def tell(self, sentence: str) -> None:
        """Tell the user, once per call."""
        if not self.told:
            notice(sentence, logging.WARNING)  # visible without any configuration of logging
        self.told = True

    def take_turn(self, folder: str) -> bool:
        """Hold the lock of a folder until the call ends; return False if it is held already."""
        if sys.platform == "win32" or self.turn is not None:
            return False
        try:
            self.turn = Path(folder, LOCK).open("a")  # noqa: SIM115 - `close` closes it
        except OSError:  # the folder cannot be written, or does not exist yet
            return False
        while time.monotonic() - self.started < LONGEST_TURN:
            with contextlib.suppress(OSError):
                fcntl.flock(self.turn, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            if time.monotonic() - self.started > UNNOTICED:
                self.tell(f"compiling {self.name}, once: another process does so, waiting ...")
            time.sleep(0.05)
        self.started = time.monotonic()
        return True

    def close(self) -> None:
        """Let other processes compile."""
        if self.turn is not None:
            self.turn.close()


def _functions_below(dispatcher: Any) -> Iterator[Any]:
    """Yield a compiled function and those that it calls, directly or not."""
    seen, ahead = set(), [dispatcher]
    while ahead:
        function = ahead.pop()
        if function in seen:
            continue
        seen.add(function)
        yield function
        scope, names = function.py_func.__globals__, function.py_func.__code__.co_names
        modules = [vars(scope[n]) for n in names if isinstance(scope.get(n), ModuleType)]
        found = [space[n] for space in (scope, *modules) for n in names if n in space]
        ahead += [value for value in found if hasattr(value, "py_func")]
