"""Joints for an assembly: which contacts must be curved (kinematic design) and into what shape (realization)."""
