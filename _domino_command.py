"""Entry point of the `domino` command, outside the packages.

Importing `domino_env` loads Gymnasium to register the environments, which takes longer than
everything else in `domino --help`. Commands need no registered environments: while the variable
DOMINO_COMMAND is set, the package does not register them. Workers and methods of other packages may
need them: workers do not inherit the variable, and `optimize.methods.registry` registers them
before it loads such a method.
"""

import os
import signal
import sys


def main() -> int:
    """Run the command and return its exit status, as `domino_env.cli.main.main` does."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        # until `main` sets a handler, Ctrl-C ends the process without a traceback
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.environ["DOMINO_COMMAND"] = "1"
    from domino_env.cli.main import main

    del os.environ["DOMINO_COMMAND"]
    code = main()
    if code > 128:  # ended by a signal: do not wait for threads that still compile or simulate
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(code)
    return code


if __name__ == "__main__":
    sys.exit(main())
