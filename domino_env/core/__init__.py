"""Helpers for all other folders: checks, files, models, tables, results, threads, plot style."""
