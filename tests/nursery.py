"""Processes to be killed, forked from one that has loaded everything, so that each starts at once.

`python nursery.py` obeys a line of JSON at a time: {"words": [...], "log": FILE} forks a child that
runs the command `domino WORDS` and tells its number; with "here" it runs in the server itself,
which then has loaded and compiled what the command needs; {"wait": number, "seconds": s} tells a
child's exit code, None if it still runs.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

ALONE = dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")


class Nursery:
    """Starts children; `close` ends it."""

    def __init__(self) -> None:
        self._server = subprocess.Popen(
            [sys.executable, "-P", __file__],  # beside it, tests/domino_env hides the package
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=os.environ | ALONE,
        )  # fmt: skip

    def warm(self, words: Sequence[object], log: Path) -> None:
        """Run the command in the server, whose children then need not load what it has loaded."""
        code = self._asked({"words": [str(word) for word in words], "log": str(log), "here": True})
        assert code == 0, log.read_text()

    def start(self, words: Sequence[object], log: Path) -> int:
        """A child that runs the command; its number."""
        return int(self._asked({"words": [str(word) for word in words], "log": str(log)}))

    def wait(self, child: int, seconds: float) -> int | None:
        """Its exit code (minus the signal that ended it), None if it runs on for so long."""
        code = self._asked({"wait": child, "seconds": seconds})
        return None if code is None else int(code)

    def run(self, words: Sequence[object], log: Path) -> float:
        """Let a child finish; the seconds that it took."""
        began = time.perf_counter()
        code = self.wait(self.start(words, log), 600.0)
        assert code == 0, log.read_text()
        return time.perf_counter() - began

    def close(self) -> None:
        """End it; children have been waited for."""
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        self._server.stdin.close()
        self._server.kill()  # it has nothing left to do, and may sit in a wait
        self._server.wait(60)
        self._server.stdout.close()

    def _asked(self, what: dict[str, Any]) -> Any:
        assert self._server.stdin is not None
        self._server.stdin.write(json.dumps(what) + "\n")
        self._server.stdin.flush()
        return self._told()

    def _told(self) -> Any:
        assert self._server.stdout is not None
        return json.loads(self._server.stdout.readline())


def _serve() -> None:
    for line in sys.stdin:
        asked = json.loads(line)
        if "here" in asked:
            _say(_command(asked["words"], asked["log"]))
        elif "words" in asked:
            child = os.fork()
            if child == 0:
                code = 130  # where Ctrl-C comes before the command begins, or when it is over
                try:
                    code = _command(asked["words"], asked["log"])
                finally:
                    os._exit(code)
            _say(child)
        else:
            _say(_exit_code(asked["wait"], time.monotonic() + asked["seconds"]))


def _exit_code(child: int, until: float) -> int | None:
    while True:
        found, status = os.waitpid(child, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        if time.monotonic() >= until:
            return None
        time.sleep(0.002)


def _command(words: Sequence[str], log: str) -> int:
    """Run a command with its output in a file; its exit code."""
    from domino_env.cli.main import main

    # a test run in the background would have its children deaf to Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)
    out, err = sys.stdout, sys.stderr
    with open(log, "a") as file, suppress(BrokenPipeError):  # noqa: PTH123
        sys.stdout = sys.stderr = file
        try:
            return main(words)
        except KeyboardInterrupt:
            return 130  # it came before the command could catch it
        except SystemExit as end:
            return int(end.code or 0)
        except Exception:
            traceback.print_exc()
            return 1
        finally:
            sys.stdout, sys.stderr = out, err
    return 1


def _say(what: object) -> None:
    print(json.dumps(what), flush=True)


if __name__ == "__main__":
    _serve()
