"""Design problems: what a scene is, what counts in it, its best uniform row, and its file."""
