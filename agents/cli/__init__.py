"""Commands of `domino`: train, evaluate, benchmark, dataset."""
