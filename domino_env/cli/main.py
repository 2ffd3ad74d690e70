"""The `domino` command: each package adds its own subcommands.

A subcommand is a module named in the entry-point group `domino.commands` that holds `SUMMARY`,
`add_arguments(parser)` and `run(arguments) -> int`, and imports what is heavy inside `run`.
"""

from __future__ import annotations

import argparse
import io
import logging
import os
import re
import signal
import sys
import threading
import warnings
from collections.abc import Sequence
from importlib.metadata import entry_points
from typing import Any, TextIO

from domino_env import __version__
from domino_env.core.files import one_line
from domino_env.core.progress import Advice


def parser() -> argparse.ArgumentParser:
    """Build the whole command line from what is installed."""
    top = argparse.ArgumentParser(
        prog="domino", description="Simulate and design rows of toppling dominoes."
    )
    top.add_argument("--version", action="version", version=f"domino {__version__}")
    commands = top.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for entry in sorted(entry_points(group="domino.commands"), key=lambda e: e.name):
        module = entry.load()
        sub = commands.add_parser(entry.name, help=module.SUMMARY, description=module.__doc__)
        sub.formatter_class = argparse.RawDescriptionHelpFormatter
        module.add_arguments(sub)
        sub.set_defaults(run=module.run)
    return top


def main(words: Sequence[str] | None = None) -> int:
    """Run a command, and return its exit status.

    Bad input ends with one line on standard error and status 2, Ctrl-C with 130, SIGTERM with 143.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a console that knows no µ shows another sign
            stream.reconfigure(errors="replace")
    arguments = parser().parse_args(words)
    interruption = _Interruption()
    notices, log = logging.StreamHandler(), logging.getLogger("domino_env")
    log.addHandler(notices)
    log.setLevel(logging.INFO)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("default", Advice)
            warnings.showwarning = _show
            code = int(arguments.run(arguments))
        sys.stdout.flush()
        return interruption.code if interruption.came else code  # with the best so far, say
    except BrokenPipeError:
        # whoever read the output has enough; what is left in the buffer has nowhere to go
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt as stop:
        print(f"domino: {str(stop) or 'interrupted'}", file=sys.stderr)
        return interruption.code
    except (ValueError, OSError, ImportError) as error:
        if interruption.came and not str(error):
            print("domino: interrupted", file=sys.stderr)
            return interruption.code
        said = re.sub(r"\[(Errno|WinError) -?\d+\] ", "", str(error))
        print(f"domino: {one_line(said, 1000)}", file=sys.stderr)
        return 2
    except Exception as error:
        if not interruption.came:
            raise
        # what a library made of the interruption, which came while it was looking for another error
        print(f"domino: interrupted ({type(error).__name__})", file=sys.stderr)
        return interruption.code
    finally:
        log.removeHandler(notices)
        interruption.undo()


_show_as_python = warnings.showwarning


def _show(
    message: Warning | str, category: type[Warning], filename: str, lineno: int,
    file: TextIO | None = None, line: str | None = None,
) -> None:  # fmt: skip
    """Print advice as a line; what libraries warn of is for who knows the program."""
    if issubclass(category, Advice):
        print(f"domino: {one_line(str(message), 1000)}", file=sys.stderr)
    else:
        _show_as_python(message, category, filename, lineno, file, line)


class _Interruption:
    """Has SIGTERM end a command as Ctrl-C does, and knows which of the two came."""

    def __init__(self) -> None:
        self.came: int = 0
        self._before: dict[int, Any] = {}
        if threading.current_thread() is threading.main_thread():
            self._catch(signal.SIGTERM)
            # who ignores Ctrl-C, as a shell has its background jobs do, goes on ignoring it
            if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
                self._catch(signal.SIGINT)

    @property
    def code(self) -> int:
        """The exit status that says what ended the command."""
        return 143 if self.came == signal.SIGTERM else 130

    def _catch(self, number: int) -> None:
        self._before[number] = signal.signal(number, self._come)

    def _come(self, number: int, _: object) -> None:
        self.came = number
        raise KeyboardInterrupt

    def undo(self) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)


if __name__ == "__main__":
    sys.exit(main())
