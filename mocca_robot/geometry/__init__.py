"""Shapes, cones and surfaces: geometry that knows nothing of contacts or forces."""
