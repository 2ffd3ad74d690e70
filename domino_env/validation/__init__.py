"""Accuracy, run times, the figures of the article, and measured chains."""
