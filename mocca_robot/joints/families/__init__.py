"""Families of solid joints, one a file, behind one protocol: a row of numbers → a height field over a contact."""
