"""Look: what people look at and build, and checks against other physics."""
