"""Quadrangles in rows → running bond: every second row shifted by half a block."""

from __future__ import annotations

import numpy as np

from mocca_robot.errors import InputError
from mocca_robot.generators.surface import Surface


def running_bond_quads(surface: Surface) -> Surface:
    """Return the surface with its quadrangles halved across each row and joined anew in pairs, the pairs of
    every second row shifted by one half.

    Rows start at the lowest quadrangles and follow the edges that point sideways there. Raises InputError when a
    polygon has not four corners.
    """
    for face in surface.faces:
        if len(face) != 4:
            where = ", ".join(f"{x:.4g}" for x in surface.points[list(face)].mean(axis=0))
            raise InputError(f"Running bond needs quadrangles; the polygon at ({where}) has {len(face)} corners.")
    points = list(surface.points)
    middles: dict[tuple[int, int], int] = {}

    def middle(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in middles:
            middles[key] = len(points)
            points.append(0.5 * (surface.points[a] + surface.points[b]))
        return middles[key]

    faces: list[tuple[int, ...]] = []
    for level, row in enumerate(_rows(surface)):
        # Corners of each quadrangle: a → b along the bottom, c → d back along the top.
        closed = len(row) > 2 and (row[0][0], row[0][3]) == (row[-1][1], row[-1][2])
        if level % 2 == 0:
            faces += row
            continue
        for (a, b, c, d), (e, f, g, h) in zip(row, row[1:] + (row[:1] if closed else [])):
            assert (b, c) == (e, h)
            faces.append((middle(a, b), b, middle(e, f), middle(g, h), c, middle(c, d)))
        if not closed:
            a, b, c, d = row[0]
            faces.append((a, middle(a, b), middle(c, d), d))
            a, b, c, d = row[-1]
            faces.append((middle(a, b), b, c, middle(c, d)))
    # Halves of an edge belong to the row above or below too.
    whole = []
    for face in faces:
        loop: list[int] = []
        for a, b in zip(face, (*face[1:], face[0])):
            loop.append(a)
            half = middles.get((min(a, b), max(a, b)))
            if half is not None:
                loop.append(half)
        whole.append(tuple(loop))
    return Surface(np.array(points), tuple(whole))


def _rows(surface: Surface) -> list[list[tuple[int, int, int, int]]]:
    """Return rows of quadrangles (a, b, c, d), a → b along the lower side, neighbours in a row after each other."""
    owners = surface.edges()
    height = surface.points[:, 2]
    faces = surface.faces
    turned: dict[int, tuple[int, int, int, int]] = {}

    def turn(face: int, start: int) -> tuple[int, int, int, int]:
        a, b, c, d = (faces[face][(start + k) % 4] for k in range(4))
        return a, b, c, d

    def across(face: int, a: int, b: int) -> int | None:
        others = [o for o in owners[(min(a, b), max(a, b))] if o != face]
        return others[0] if others else None

    middle = [float(height[list(f)].mean()) for f in faces]
    rows: list[list[tuple[int, int, int, int]]] = []
    left = set(range(len(faces)))
    while left:
        seed = min(left, key=lambda f: (round(middle[f], 9), f))
        known = [k for k in range(4) if (o := across(seed, *turn(seed, k)[:2])) is not None and o in turned]
        lows = [float(height[list(turn(seed, k)[:2])].mean()) for k in range(4)]
        start = min(known, key=lambda k: lows[k]) if known else int(np.argmin(lows))
        row = {seed: turn(seed, start)}
        line = [seed]
        for forward in (True, False):
            here = seed
            while True:
                a, b, c, d = row[here]
                edge = (b, c) if forward else (d, a)
                there = across(here, *edge)
                if there is None or there not in left or there in row:
                    break
                # The neighbour's side towards `here` is its left one going forwards, its right one going back:
                # its corner d, or its corner b.
                position = faces[there].index(edge[1])
                row[there] = turn(there, (position + 1) % 4 if forward else (position - 1) % 4)
                line = [*line, there] if forward else [there, *line]
                here = there
        left -= set(line)
        turned.update(row)
        rows.append([row[f] for f in line])
    return rows
