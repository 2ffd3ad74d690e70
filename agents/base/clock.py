"""Clock: what a training has taken so far, the times before it was stopped and resumed included."""

from __future__ import annotations

import time


class Clock:
    """Runs from when it is made."""

    def __init__(self) -> None:
        self._began, self._began_work = time.perf_counter(), time.process_time()
        self._spent = self._worked = 0.0

    @property
    def seconds(self) -> float:
        """Wall-clock time [s]."""
        return self._spent + time.perf_counter() - self._began

    @property
    def processor_seconds(self) -> float:
        """Processor time of all threads [s]."""
        return self._worked + time.process_time() - self._began_work

    def go_on(self, seconds: float, processor_seconds: float) -> None:
        """Add what earlier sessions took [s]."""
        self._spent, self._worked = seconds, processor_seconds
