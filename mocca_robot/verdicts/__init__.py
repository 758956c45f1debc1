"""Verdicts on what was built, from its geometry alone."""
