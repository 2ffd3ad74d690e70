"""What people look at, listen to and build: drawings, films, sounds, templates, reports."""
