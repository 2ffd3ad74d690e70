"""The `domino` command, from outside the package.

Importing `domino_env` loads Gymnasium to register the environments, which takes longer than all of
`domino --help`.  Commands make no environment by its name: where this module has been loaded first,
the package leaves that out.
"""

import sys


def main() -> int:
    """Run the command; see `domino_env.cli.main.main`."""
    from domino_env.cli.main import main

    return main()


if __name__ == "__main__":
    sys.exit(main())
