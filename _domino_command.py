"""The `domino` command, from outside the package.

Importing `domino_env` loads Gymnasium to register the environments, which takes longer than all of
`domino --help`. Commands make no environment by its name: if this module is loaded first, the
package does not register them.
"""

import os
import signal
import sys


def main() -> int:
    """Run the command; see `domino_env.cli.main.main`."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        # Ctrl-C during the imports ends the process without a traceback; main() replaces this
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from domino_env.cli.main import main

    code = main()
    if code > 128:  # of a signal: threads that still compile or simulate are not waited for
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


if __name__ == "__main__":
    sys.exit(main())
