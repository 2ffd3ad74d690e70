"""The standard domino, which stands wherever nothing else is said."""

HEIGHT, WIDTH, DENSITY = 0.048, 0.024, 1040.0  # [m], [m], [kg/m³]
THICKNESS = 0.0075  # [m]
