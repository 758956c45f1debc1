"""Flat shapes as shapely knows them."""

from __future__ import annotations

import shapely

from mocca_robot.assembly import Polygon


def to_shapely(polygon: Polygon) -> shapely.Polygon:
    """Return `polygon` as a shapely polygon."""
    return shapely.Polygon(polygon.exterior, polygon.holes)
