"""Drawings, animations, sounds, templates and reports of layouts and waves."""
