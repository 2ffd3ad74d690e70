"""The `domino` command: one module a subcommand."""
