"""The `domino` command, to which each package adds its subcommands.

A subcommand is a module in the entry-point group `domino.commands` with a docstring, whose first
line `domino --help` shows, `add_arguments(parser)` and `run(arguments) -> int`, which returns the
exit status. It imports heavy modules inside `run`, so that `domino --help` is fast.
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
from pathlib import Path
from typing import Any, NoReturn, TextIO

from domino_env import __version__
from domino_env.core.files import one_line
from domino_env.core.progress import Advice, WrongUnit, notice

GROUP = "domino.commands"
INTERRUPTED = "interrupted before the end: run the command again"
MAX_MESSAGE = 1000  # [characters]
PURPOSES = {
    "simulate": "simulate",
    "search": "scene optimize compare sweep studies best-known",
    "learn": "train evaluate benchmark dataset",
    "build and look": "studio render report template click measure",
    "validate": "verify validate accuracy figures",
}
"""Commands by purpose, in the order of `domino --help`; all others follow."""


class _Parser(argparse.ArgumentParser):
    """Parser that raises errors, which `main` prints in one line, instead of exiting."""

    def error(self, message: str) -> NoReturn:
        """Raise a ValueError."""
        # the checks of `options` are called without a name, which argparse adds before " = "
        message = message.removeprefix("argument ").replace(":  = ", " = ")
        usage = re.search("required|unrecognized|expected|choice|not allowed", message)
        raise ValueError(f"{message}{f' ({self.prog} --help)' if usage else ''}")


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the commands of all installed packages."""
    modules = {entry.name: entry.load() for entry in entry_points(group=GROUP)}
    grouped = " ".join(PURPOSES.values()).split()
    others = {"more": " ".join(sorted(modules.keys() - {*grouped}))}
    lines = ["Simulate and design chains of toppling dominoes."]
    for purpose, names in (PURPOSES | others).items():
        known = [name for name in names.split() if name in modules]
        lines += [f"\n{purpose}:"] * bool(known)
        lines += [f"  {name:<11} {modules[name].__doc__.splitlines()[0]}" for name in known]
    lines += ["\ndomino COMMAND --help explains a command and its options."]
    parser = _Parser(
        prog="domino", usage="domino COMMAND [OPTIONS]", description="\n".join(lines),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("--version", action="version", version=f"domino {__version__}")
    commands = parser.add_subparsers(
        prog="domino", metavar="COMMAND", required=True, help=argparse.SUPPRESS
    )
    for name, module in modules.items():
        command = commands.add_parser(name, description=module.__doc__)
        command.formatter_class = argparse.RawDescriptionHelpFormatter
        module.add_arguments(command)
        command.set_defaults(run=module.run)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    argv
        Command and its arguments; by default those of the process.

    Returns
    -------
    int
        Exit status: 0 for success, 1 if a check of the command fails, 2 after invalid input, which
        is explained in one line on standard error, 130 after Ctrl-C, 141 if the program that reads
        the output has ended, and 143 after SIGTERM.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed at the start, as for services: nobody reads the output
            sink = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - for the process
            setattr(sys, name, sink)
        if isinstance(stream, io.TextIOWrapper):  # a console without µ shows a replacement
            stream.reconfigure(errors="replace")
    interruption = _Interruption()
    notices, log = _Notices(), logging.getLogger("domino_env")
    log.addHandler(notices)
    log.setLevel(logging.INFO)
    try:
        argv = list(sys.argv[1:] if argv is None else argv)
        names = sorted(entry_points(group=GROUP).names)
        if argv and argv[0] not in ["-h", "--help", "--version", *names]:
            from domino_env.core.checks import require_choice

            require_choice("COMMAND", argv[0], names)  # argparse does not suggest a similar name
        parser = build_parser()
        parser.prog = " ".join(["domino", *argv[:1]])  # for messages about unknown arguments
        arguments = parser.parse_args(argv)
        with warnings.catch_warnings():
            warnings.simplefilter("default", Advice)
            warnings.simplefilter("error", WrongUnit)
            warnings.showwarning = _show_warning
            code = int(arguments.run(arguments))
        sys.stdout.flush()
        # an interrupted search returns normally, with its best layout so far
        return interruption.code if interruption.signal else code
    except BrokenPipeError:
        # the program that reads the output has closed it: the rest of the buffer is discarded
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + 13  # as a program that SIGPIPE ends
    except KeyboardInterrupt as error:
        print(f"domino: {str(error) or INTERRUPTED}", file=sys.stderr)
        return interruption.code
    except Exception as error:
        is_known = isinstance(error, ValueError | OSError | WrongUnit) and str(error)
        if interruption.signal and not is_known:  # a library raised this for the interruption
            print(f"domino: {INTERRUPTED}", file=sys.stderr)
            return interruption.code
        if not isinstance(error, ValueError | OSError | ImportError | WrongUnit):
            raise
        text = " ".join([str(error), *getattr(error, "__notes__", ())])
        message = re.sub(r"\[(Errno|WinError) -?\d+\] ", "", text)
        if isinstance(error, OSError) and error.strerror:
            place = error.filename or "the output"  # errors of writing have no name of a file
            message = f"{place}: {error.strerror}: name another file or folder"
        print(f"domino: {one_line(message, MAX_MESSAGE)}", file=sys.stderr)
        return 2
    finally:
        log.removeHandler(notices)
        interruption.restore()


class _Notices(logging.Handler):
    """Handler that prints each notice on a line of its own, above a progress bar."""

    def emit(self, record: logging.LogRecord) -> None:
        from tqdm import tqdm

        tqdm.write(record.getMessage(), file=sys.stderr)


_show_as_python = warnings.showwarning


def _show_warning(
    message: Warning | str, category: type[Warning], filename: str, lineno: int,
    file: TextIO | None = None, line: str | None = None,
) -> None:  # fmt: skip
    """Print advice as one line, and warnings of libraries as Python does."""
    if issubclass(category, Advice):
        notice(f"domino: {one_line(str(message), MAX_MESSAGE)}")
    else:
        _show_as_python(message, category, filename, lineno, file, line)


class _Interruption:
    """Handlers that let SIGTERM end a command as Ctrl-C does, and record the signal."""

    def __init__(self) -> None:
        self.signal: int = 0  # number of the last signal; 0 for none
        self._previous_handlers: dict[int, Any] = {}
        if threading.current_thread() is threading.main_thread():
            self._catch(signal.SIGTERM)
            # a process that ignores Ctrl-C, such as a background job, continues to ignore it
            if signal.getsignal(signal.SIGINT) in (signal.default_int_handler, signal.SIG_DFL):
                self._catch(signal.SIGINT)

    @property
    def code(self) -> int:
        """Exit status for the signal that ended the command: 128 plus its number."""
        return 143 if self.signal == signal.SIGTERM else 130

    def _catch(self, number: int) -> None:
        self._previous_handlers[number] = signal.signal(number, self._interrupt)

    def _interrupt(self, number: int, _: object) -> None:
        self.signal = number
        raise KeyboardInterrupt

    def restore(self) -> None:
        """Restore the previous handlers."""
        for number, handler in self._previous_handlers.items():
            signal.signal(number, handler)
