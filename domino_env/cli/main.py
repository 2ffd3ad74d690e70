"""The `domino` command: each package adds its own subcommands.

A subcommand is a module in the entry-point group `domino.commands` with `SUMMARY`,
`add_arguments(parser)` and `run(arguments) -> int`; it imports heavy modules inside `run`.
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
from typing import Any, NoReturn, TextIO

from domino_env import __version__
from domino_env.core.files import one_line
from domino_env.core.progress import Advice, WrongUnit

GROUP = "domino.commands"
PURPOSES = {
    "simulate": "simulate",
    "search": "scene optimize compare sweep studies best-known",
    "learn": "train evaluate benchmark dataset",
    "build and look": "studio render report template click listen",
    "validate": "verify validate accuracy figures",
}
"""Commands by purpose, in the order of `domino --help`; those of other packages follow."""


class _Parser(argparse.ArgumentParser):
    """Parser whose errors are one line, as those of commands."""

    def error(self, message: str) -> NoReturn:
        """Raise a ValueError."""
        message = message.removeprefix("argument ").replace(":  = ", " = ")
        usage = re.search("required|unrecognized|expected|choice|not allowed", message)
        raise ValueError(f"{message}{f' ({self.prog} --help)' if usage else ''}")


def parser() -> argparse.ArgumentParser:
    """Build the command line from the commands of all installed packages."""
    modules = {entry.name: entry.load() for entry in entry_points(group=GROUP)}
    grouped = " ".join(PURPOSES.values()).split()
    more = {"more": " ".join(sorted(modules.keys() - {*grouped}))}
    lines = ["Simulate and design chains of toppling dominoes."]
    for purpose, names in (PURPOSES | more).items():
        known = [name for name in names.split() if name in modules]
        lines += [f"\n{purpose}:"] * bool(known)
        lines += [f"  {name:<11} {modules[name].SUMMARY}" for name in known]
    lines += ["\ndomino COMMAND --help explains a command and its options."]
    top = _Parser(
        prog="domino", usage="domino COMMAND [OPTIONS]", description="\n".join(lines),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    top.add_argument("--version", action="version", version=f"domino {__version__}")
    commands = top.add_subparsers(
        prog="domino", metavar="COMMAND", required=True, help=argparse.SUPPRESS
    )
    for name, module in modules.items():
        sub = commands.add_parser(name, description=module.__doc__)
        sub.formatter_class = argparse.RawDescriptionHelpFormatter
        module.add_arguments(sub)
        sub.set_defaults(run=module.run)
    return top


def main(words: Sequence[str] | None = None) -> int:
    """Run a command, and return its exit status.

    Bad input ends with one line on standard error and status 2, Ctrl-C with 130, SIGTERM with 143.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a console without µ prints a replacement
            stream.reconfigure(errors="replace")
    interruption = _Interruption()
    notices, log = _Notices(), logging.getLogger("domino_env")
    log.addHandler(notices)
    log.setLevel(logging.INFO)
    try:
        words = list(sys.argv[1:] if words is None else words)
        names = sorted(entry_points(group=GROUP).names)
        if words and words[0] not in ["-h", "--help", "--version", *names]:
            from domino_env.core.checks import require_choice

            require_choice("COMMAND", words[0], names)  # argparse suggests no similar one
        top = parser()
        top.prog = " ".join(["domino", *words[:1]])  # of arguments that no command takes
        arguments = top.parse_args(words)
        with warnings.catch_warnings():
            warnings.simplefilter("default", Advice)
            warnings.simplefilter("error", WrongUnit)
            warnings.showwarning = _show
            code = int(arguments.run(arguments))
        sys.stdout.flush()
        return interruption.code if interruption.signal else code  # such as with the best so far
    except BrokenPipeError:
        # the reader has closed the output: the rest of the buffer is discarded
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt as stop:
        print(f"domino: {str(stop) or 'interrupted'}", file=sys.stderr)
        return interruption.code
    except (ValueError, OSError, ImportError, WrongUnit) as error:
        if interruption.signal and (isinstance(error, ImportError) or not str(error)):
            print("domino: interrupted", file=sys.stderr)
            return interruption.code
        message = re.sub(r"\[(Errno|WinError) -?\d+\] ", "", str(error))
        if isinstance(error, OSError) and error.filename is not None:
            message = f"{error.filename}: {error.strerror}: name another file or folder"
        print(f"domino: {one_line(message, 1000)}", file=sys.stderr)
        return 2
    except Exception as error:
        if not interruption.signal:
            raise
        # a library raised this for the interruption, while it handled another error
        print(f"domino: interrupted ({type(error).__name__})", file=sys.stderr)
        return interruption.code
    finally:
        log.removeHandler(notices)
        interruption.undo()


def _print_line(line: str) -> None:
    """Print a line on standard error, above the bar of a progress that is shown there."""
    from tqdm import tqdm

    tqdm.write(line, file=sys.stderr)


class _Notices(logging.Handler):
    """Handler that prints notices as lines."""

    def emit(self, record: logging.LogRecord) -> None:
        _print_line(record.getMessage())


_show_as_python = warnings.showwarning


def _show(
    message: Warning | str, category: type[Warning], filename: str, lineno: int,
    file: TextIO | None = None, line: str | None = None,
) -> None:  # fmt: skip
    """Print advice as one line, and warnings of libraries as Python does."""
    if issubclass(category, Advice):
        _print_line(f"domino: {one_line(str(message), 1000)}")
    else:
        _show_as_python(message, category, filename, lineno, file, line)


class _Interruption:
    """Handlers that let SIGTERM end a command as Ctrl-C does, and record which of them came."""

    def __init__(self) -> None:
        self.signal: int = 0
        self._previous_handlers: dict[int, Any] = {}
        if threading.current_thread() is threading.main_thread():
            self._catch(signal.SIGTERM)
            # a process that ignores Ctrl-C, such as a background job, goes on ignoring it
            if signal.getsignal(signal.SIGINT) in (signal.default_int_handler, signal.SIG_DFL):
                self._catch(signal.SIGINT)

    @property
    def code(self) -> int:
        """Exit status for the signal that ended the command."""
        return 143 if self.signal == signal.SIGTERM else 130

    def _catch(self, number: int) -> None:
        self._previous_handlers[number] = signal.signal(number, self._interrupt)

    def _interrupt(self, number: int, _: object) -> None:
        self.signal = number
        raise KeyboardInterrupt

    def undo(self) -> None:
        for number, before in self._previous_handlers.items():
            signal.signal(number, before)


if __name__ == "__main__":
    sys.exit(main())
