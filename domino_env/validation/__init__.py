"""What is measured: accuracy, run times, the article's figures, rows of real dominoes."""
