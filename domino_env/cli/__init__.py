"""The `domino` command, with one module for each subcommand."""
