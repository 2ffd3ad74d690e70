"""One scene varied: its points, the runs, the page, the pictures, how fast it goes."""
