"""`python -m domino_env` is the `domino` command."""

import sys

from domino_env.command import main

sys.exit(main())
