"""The scene of an insertion: one part in the hand, its neighbours held, or free to move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.assembly import Array, Assembly, BoolArray
from mocca_robot.contacts import Contact
from sim.contact_model import ContactModel, facets, pieces
from sim.directions import InsertionCone
from sim.flat_pieces import flat_pieces
from sim.hand import HAND, HandOptions, HandPath
from sim.motion import LOOK, displacement_and_speed, reach
from sim.scene import Compiled, Hand, Scene, compile_scene
from sim.settings import settings_for
from sim.solid_pieces import solid_pieces

SETTLING_STEPS = 200
"""At most, for what is left free to sink into its contacts; the igloo's 126 parts rest after 40."""
RESTS = 1e-6
"""Sizes per second below which what sank rests."""


@dataclass(frozen=True, eq=False)
class InsertionScene:
    """A compiled scene with one part in the hand, to be used for any number of trials.

    Attributes:
        compiled: the model; the driven part's joints are at zero when it is seated.
        cone: of the driven part.
        clearance: metres.
        below: 'held' or 'free'.
        travel_points: (P, d) contact points that the part has to clear.
        sunk: metres that any point of the part's neighbours sinks before it arrives, because contacts give: it meets
            them by so much off their places. 0 when they are held.
    """

    compiled: Compiled
    cone: InsertionCone
    clearance: float
    below: str
    travel_points: tuple[Array, ...]
    sunk: float = 0.0

    def travel(self, way: Array, hand: HandOptions = HAND) -> float:
        """Return how far before its seat the part clears what it will touch, at most 1.5 sizes, and the lead."""
        size = 2.0 * float(reach(self.compiled.scene.assembly)[self.cone.part])
        heights = [float(np.ptp(points @ way)) for points in self.travel_points]
        return min(1.5 * size, max(heights, default=0.0)) + hand.lead * size


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
    mine = [c for c in contacts if c.parts[1] == index]
    polygons = [c.polygon for c in mine]
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
    points = (np.concatenate(polygons),) if polygons else ()
    ready = InsertionScene(compile_scene(scene), cone, clearance, below, points)
    return ready if below == "held" else replace(ready, sunk=_sunk(ready, {c.parts[0] for c in mine}, hand))


def _sunk(ready: InsertionScene, neighbours: set[int], hand: HandOptions) -> float:
    """Return how far the free ones among these parts sink while the hand waits at the start of the cone's axis."""
    import mujoco

    compiled, part, way = ready.compiled, ready.cone.part, ready.cone.axis
    met = np.isin(compiled.parts, list(neighbours))
    if not met.any():
        return 0.0
    far = reach(compiled.scene.assembly)[compiled.parts]
    offset = np.zeros(compiled.dof.shape[1])
    path = HandPath(compiled.model, compiled, part, way, ((ready.travel(way, hand), SETTLING_STEPS),), offset)
    data = mujoco.MjData(compiled.model)
    path.place(data)
    mujoco.mj_forward(compiled.model, data)
    start = data.qpos.copy()
    data.ctrl[:] = path.commands[0]
    sunk = np.zeros(len(far))
    for _ in range(SETTLING_STEPS // LOOK):
        mujoco.mj_step(compiled.model, data, LOOK)
        sunk, speed = displacement_and_speed(compiled, data, start, far)
        if (speed[met] <= RESTS * 2.0 * far[met]).all():
            break
    return float(sunk[met].max())


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
