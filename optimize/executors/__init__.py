"""Who does the work of many tasks: a `concurrent.futures.Executor` each.

None               this process, one task after the other, rows of a batch shared among its threads
ProcessExecutor    processes of this machine
DaskExecutor       Dask workers, of this machine or many

Results are the same to the bit whoever works: a task carries all that decides them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from optimize.executors.base import ExecutorLost, WorkerLost
    from optimize.executors.choice import open_executor

__all__ = ["ExecutorLost", "WorkerLost", "open_executor"]

# loaded when asked for: every command has the options, few start an executor
_HOMES = {"ExecutorLost": "base", "WorkerLost": "base", "open_executor": "choice"}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'optimize.executors' has no attribute '{name}'")
    return getattr(import_module(f"optimize.executors.{_HOMES[name]}"), name)
