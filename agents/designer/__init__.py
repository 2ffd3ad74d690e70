"""The designer: a policy that reads the scene and proposes a layout at once."""
