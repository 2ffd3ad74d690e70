"""Rows of rigid bodies, free on a floor or hinged to it, that know no analytic model."""
