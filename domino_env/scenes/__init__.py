"""Design problems: scenes, their objectives, uniform baselines and files."""
