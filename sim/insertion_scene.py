"""The scene of an insertion: one part in the hand, its neighbours held, or free to move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mocca_robot.assembly import Array, Assembly, BoolArray
from mocca_robot.contacts import Contact
from sim.contact_model import ContactModel, facets, pieces
from sim.directions import InsertionCone
from sim.flat_pieces import flat_pieces
from sim.hand import HAND, HandOptions
from sim.motion import reach
from sim.scene import Compiled, Hand, Scene, compile_scene
from sim.settings import settings_for
from sim.solid_pieces import solid_pieces


@dataclass(frozen=True, eq=False)
class InsertionScene:
    """A compiled scene with one part in the hand, to be used for any number of trials.

    Attributes:
        compiled: the model; the driven part's joints are at zero when it is seated.
        cone: of the driven part.
        clearance: metres.
        below: 'held' or 'free'.
        travel_points: (P, d) contact points that the part has to clear.
    """

    compiled: Compiled
    cone: InsertionCone
    clearance: float
    below: str
    travel_points: tuple[Array, ...]


def insertion_scene(
    assembly: Assembly,
    contacts: Sequence[Contact],
    cone: InsertionCone,
    *,
    resting: ContactModel | None = None,
    clearance: float = 0.0,
    below: str = "held",
    friction: float = 0.0,
    hand: HandOptions = HAND,
) -> InsertionScene:
    """Return the scene in which part `cone.part` goes in on top of all earlier ones.

    `resting` is `resting_model` of the assembly, when it is at hand. `below` is 'held' or 'free'.
    """
    index = cone.part
    model = insertion_model(assembly, contacts, index, clearance, below, resting)
    polygons = [c.polygon for c in contacts if c.parts[1] == index]
    present = np.arange(len(assembly.parts)) <= index
    held = np.arange(len(assembly.parts)) < index if below == "held" else assembly.fixed
    weight = assembly.parts[index].mass * float(np.linalg.norm(assembly.gravity))
    far = float(reach(assembly)[index])
    stiffness = hand.stiffness * weight / (2.0 * far)
    settings = settings_for(assembly, friction, int((present & ~held).sum()))
    scene = Scene(
        assembly,
        model,
        present if below == "free" else _nearby(assembly, index, present),
        np.asarray(held),
        assembly.gravity,
        settings,
        Hand(index, stiffness, stiffness * far**2),
    )
    return InsertionScene(compile_scene(scene), cone, clearance, below, (np.concatenate(polygons),) if polygons else ())


def _nearby(assembly: Assembly, part: int, present: BoolArray) -> BoolArray:
    """Return the part and those earlier ones whose bounding boxes its way in can meet."""
    low, high = assembly.parts[part].shape.bounds
    margin = 2.0 * float(np.linalg.norm(high - low))
    bounds = np.array([p.shape.bounds for p in assembly.parts])
    near = ((bounds[:, 1] > low - margin) & (bounds[:, 0] < high + margin)).all(axis=1)
    return np.asarray(present & near)


def resting_model(assembly: Assembly, contacts: Sequence[Contact]) -> ContactModel:
    """Return what the parts carry each other by, of which the scenes of all insertions are made."""
    return pieces(assembly, contacts) if assembly.dimension == 2 else facets(contacts)


def insertion_model(
    assembly: Assembly,
    contacts: Sequence[Contact],
    part: int,
    clearance: float,
    below: str = "held",
    resting: ContactModel | None = None,
) -> ContactModel:
    """Return the contact model that stays true while `part`, smaller by `clearance`, travels; see `insertion_scene`."""
    if assembly.dimension == 2:
        return flat_pieces(assembly, resting_model(assembly, contacts) if resting is None else resting, part, clearance)
    if below == "held":
        return solid_pieces(contacts, part, clearance)
    earlier = np.arange(len(assembly.parts)) < part
    resting = resting_model(assembly, [c for c in contacts if c.parts[1] < part]) if resting is None else resting
    return solid_pieces(contacts, part, clearance, resting.only(earlier))
