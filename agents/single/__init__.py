"""Policies for one scene: they build in the environment, domino by domino."""
