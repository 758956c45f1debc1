"""Directions in which something slides along what it touches: the lines and planes of a cone without width."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.geometry.cones import extreme_rays
from mocca_robot.geometry.frames import tangents
from mocca_robot.tolerances import TINY

LEAN = 1e-3
"""Singular value of directions that span one more dimension; and the share of leaving faces that turns a middle."""

SLIDE = 1e-6
"""Sine by which a way may run into a face and still slides along it: files of six digits turn faces by as much."""
MOST_NORMALS = 60
"""Faces whose edges are all looked at, two by two."""
TURNS = 24
"""Directions around a plane."""


def sliding_ways(normals: Array) -> tuple[Array, bool]:
    """Return unit directions (m, d) on the boundary of V = {x : n̂·x ≥ 0} for unit `normals` (k, d), and whether these
    are all of V.

    They are: the directions along every edge of V, in both senses where both are free, and `TURNS` ones around every
    plane that bounds V or is V (parts between cheeks, in slots and drawers). Those with most room to the other faces
    come first. They are all of V when V is a point, a ray or a line.
    """
    d = normals.shape[1]
    if len(normals) == 0:
        return np.zeros((0, d)), False
    distinct = np.unique(np.round(normals, 9), axis=0)
    whole = len(distinct) <= MOST_NORMALS
    if not whole:
        distinct = distinct[extreme_rays(distinct)]
        whole = len(distinct) <= MOST_NORMALS
        distinct = distinct[:MOST_NORMALS]
    edges = _free(normals, _edges(distinct))
    span = int(np.linalg.matrix_rank(edges, tol=LEAN)) if len(edges) else 0
    if d == 2 or span <= 1:
        return edges, whole and span <= 1
    turn = 2 * np.pi * np.arange(TURNS) / TURNS
    across = tangents(distinct)
    around = np.cos(turn)[:, None] * across[:, None, 0] + np.sin(turn)[:, None] * across[:, None, 1]
    inside = np.concatenate([edges, _middle(normals, edges), around.reshape(-1, 3)])
    return _free(normals, inside), False


def _edges(normals: Array) -> Array:
    """Return directions (m, d), of which those that run into no face generate V: what is square to all normals, and the
    edges of V across that.
    """
    _, spread, axes = np.linalg.svd(normals, full_matrices=True)
    rank = int((spread > SLIDE * spread[0]).sum())
    within, line = axes[:rank], axes[rank:]
    if rank == 1:
        across = within
    elif rank == 2:
        across = tangents(_unit(normals @ within.T))[:, 0] @ within
    else:
        a, b = np.triu_indices(len(normals), 1)
        across = np.cross(normals[a], normals[b])
    return np.concatenate([line, -line, across, -across])


def _unit(rows: Array) -> Array:
    return np.asarray(rows / np.maximum(np.linalg.norm(rows, axis=1), TINY)[:, None])


def _free(normals: Array, ways: Array) -> Array:
    """Return those of `ways` that run into no face, as distinct unit vectors: most room to faces they leave
    first, then what leads up.
    """
    length = np.linalg.norm(ways, axis=1)
    unit = ways[length > SLIDE] / length[length > SLIDE, None]
    lift = unit @ normals.T
    free = np.asarray(lift.min(axis=1, initial=1.0) >= -SLIDE)
    unit, lift = unit[free], lift[free]
    _, first = np.unique(np.round(unit, 6), axis=0, return_index=True)
    first = np.sort(first)
    unit, lift = unit[first], lift[first]
    # A face that no direction leaves tells nothing apart.
    left = np.asarray((lift > SLIDE).any(axis=0))
    room = lift[:, left].min(axis=1, initial=1.0)
    return np.asarray(unit[np.lexsort((-np.round(unit[:, -1], 6), -np.round(room, 6)))])


def _middle(normals: Array, edges: Array) -> Array:
    """Return a direction (1, d) amid the edges, clear of every face that any of them leaves."""
    lift = edges @ normals.T
    leaving = normals[np.asarray((lift > SLIDE).any(axis=0))].sum(axis=0)
    return np.stack([edges.sum(axis=0) + LEAN * leaving])
