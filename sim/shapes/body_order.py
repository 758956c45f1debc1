"""In which order parts become bodies: how fast MuJoCo is on large structures depends on it."""

from __future__ import annotations

import numpy as np

from mocca_robot.arrays import BoolArray, IntArray
from mocca_robot.statics.solver.sparse import minimum_degree
from sim.shapes.contact_model import ContactModel


def body_order(model: ContactModel, free: BoolArray) -> IntArray:
    """Return the parts (F,) where `free` (N,) is true in the order that fills MuJoCo's factor least.

    Newton's method factors a sparse matrix over all free bodies, from the last to the first, and does not permute it:
    on an igloo that is four fifths of a step. A body fills in less the later it stands and the fewer it touches, so
    this is the order of minimum degree, reversed. Without pairs nothing is known of who touches whom: parts stay as
    they are.
    """
    parts = np.flatnonzero(free)
    place = np.full(len(free), -1)
    place[parts] = np.arange(len(parts))
    owners = place[[g.part for g in model.geoms]]
    touching = np.sort(owners[np.array(model.pairs or (), dtype=np.int64).reshape(-1, 2)], axis=1)
    touching = np.unique(touching[touching[:, 0] >= 0], axis=0)
    if not len(touching):
        return parts
    place_of = minimum_degree(touching[:, 0], touching[:, 1], len(parts))
    return parts[np.argsort(place_of)[::-1]]
