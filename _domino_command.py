"""The `domino` command, from outside the package.

Importing `domino_env` loads Gymnasium to register the environments, which takes longer than all of
`domino --help`. Commands make no environment by its name: if this module is loaded first, the
package does not register them.
"""

import signal
import sys


def main() -> int:
    """Run the command; see `domino_env.cli.main.main`."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        # Ctrl-C during the imports ends the process without a traceback; main() replaces this
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from domino_env.cli.main import main

    return main()


if __name__ == "__main__":
    sys.exit(main())
