"""Analytic policy gradient: learning along the exact slope of the rows that a policy builds."""
