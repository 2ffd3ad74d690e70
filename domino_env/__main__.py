"""The `domino` command, run by `python -m domino_env`."""

import sys

from domino_env.cli.main import main

sys.exit(main())
