"""Rows that people measured."""
