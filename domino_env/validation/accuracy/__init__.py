"""Error against run time, beside the steppers of the field and 60 digits."""
