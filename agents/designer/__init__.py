"""Designer: a scene-conditioned policy that designs a layout at once."""
