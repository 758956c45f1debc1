"""Insertion trials: parts driven home by a compliant hand, all over their cone."""
