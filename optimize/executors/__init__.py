"""Who does the work of many tasks: a `concurrent.futures.Executor` each.

None               this process, one task after the other, rows of a batch shared among its threads
ProcessExecutor    processes of this machine
DaskExecutor       Dask workers, of this machine or many

Results are the same to the bit whoever works: a task carries all that decides them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from optimize.executors.base import ExecutorLost, WorkerLost
    from optimize.executors.choice import open_executor

__all__ = ["ExecutorLost", "WorkerLost", "open_executor"]

# loaded when asked for: every command has the options, few start an executor
__getattr__, __dir__, _ = lazy_loader.attach(
    __name__, submod_attrs={"base": ["ExecutorLost", "WorkerLost"], "choice": ["open_executor"]}
)
