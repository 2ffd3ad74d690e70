"""Methods against each other: the runs, the page, the pictures."""
