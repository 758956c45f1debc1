"""Configurations: their keys, and from a file that holds parts to everything a run needs."""
