"""Experiments: problems × methods × settings × seeds, run by executors and kept in a store."""
