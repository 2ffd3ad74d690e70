"""Helpers of all other folders: checks, files, tables, progress, plot style."""
