"""The scene of an insertion: one part in the hand, its neighbours held, or free to move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.assembly import Assembly
from mocca_robot.contacts.contact import Contact
from mocca_robot.motion.parts_graph import PartsGraph
from sim.insertion.directions import InsertionCone
from sim.insertion.hand import HAND, HandOptions, HandPath
from sim.motion import LOOK, displacement_and_speed, let_go_gently, reach
from sim.scene import Compiled, PushingHand, Scene, compile_scene, with_timestep
from sim.settings import KEEPS, RESTS, settings_for
from sim.shapes.contact_model import ContactModel, facets, pieces
from sim.shapes.flat_pieces import flat_pieces
from sim.shapes.solid_pieces import solid_pieces
from sim.stability import LIMITS

SETTLING_STEPS = 200
"""At most, for what is left free to sink into its contacts; the igloo's 126 parts rest after 40."""


@dataclass(frozen=True, eq=False, kw_only=True)
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
        finer: divisor of the settings' step with which all free parts keep their places; see `KEEPS`.
    """

    compiled: Compiled
    cone: InsertionCone
    clearance: float
    below: str
    travel_points: tuple[Array, ...]
    sunk: float = 0.0
    finer: float = 1.0

    @property
    def below_dof(self) -> IntArray:
        """Return (F·dof,) the indices of the velocities of all parts but the driven one."""
        return np.asarray(self.compiled.dof[self.compiled.parts != self.cone.part].ravel())

    def gentle_steps(self, hand: HandOptions = HAND) -> int:
        """Return for how many steps the free parts are let go gently; see `sim.motion.run`."""
        in_time = round(LIMITS.gentle_s / float(self.compiled.model.opt.timestep))
        return min(in_time, round(hand.steps * self.finer) // 5)

    def travel(self, way: Array, hand: HandOptions = HAND) -> float:
        """Return how far before its seat the part clears what it will touch, at most 1.5 sizes, and the lead."""
        size = 2.0 * float(reach(self.compiled.scene.assembly)[self.cone.part])
        heights = [float(np.ptp(points @ way)) for points in self.travel_points]
        return min(1.5 * size, max(heights, default=0.0)) + hand.lead * size


def insertion_scene(
    graph: PartsGraph,
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
    assembly, index = graph.assembly, cone.part
    model = insertion_model(graph, index, clearance, below, resting)
    polygons = [c.polygon for m in graph.placed(index).before for c in m.contacts]
    present = np.arange(len(assembly.parts)) <= index
    held = np.arange(len(assembly.parts)) < index if below == "held" else assembly.fixed
    weight = assembly.parts[index].mass * float(np.linalg.norm(assembly.gravity))
    far = float(reach(assembly)[index])
    stiffness = hand.stiffness * weight / (2.0 * far)
    settings = settings_for(assembly, friction, int((present & ~held).sum()))
    scene = Scene(
        assembly=assembly,
        contact_model=model,
        present=present if below == "free" else _nearby(assembly, index, present),
        held=np.asarray(held),
        gravity=assembly.gravity,
        settings=settings,
        hand=PushingHand(index, stiffness, stiffness * far**2),
    )
    points = (np.concatenate(polygons),) if polygons else ()
    ready = InsertionScene(
        compiled=compile_scene(scene), cone=cone, clearance=clearance, below=below, travel_points=points
    )
    return ready if below == "held" else _settled(ready, graph.neighbours_before(index), hand)


def _settled(ready: InsertionScene, neighbours: Sequence[int], hand: HandOptions) -> InsertionScene:
    """Return the scene with the step that its free parts need to keep their places, and how far the neighbours sink."""
    first = ready.compiled
    for divisor in (1.0, *LIMITS.finer):
        settings = first.scene.settings
        compiled = with_timestep(first, settings.timestep / divisor) if divisor > 1.0 else first
        ready = replace(ready, compiled=compiled, finer=divisor)
        sunk, speed = _left_alone(ready, hand)
        if (sunk <= KEEPS).all() and (speed <= LIMITS.speed).all():
            break
    size = 2.0 * reach(first.scene.assembly)[first.parts]
    met = np.isin(first.parts, neighbours)
    return replace(ready, sunk=float((sunk * size)[met].max(initial=0.0)))


def _left_alone(ready: InsertionScene, hand: HandOptions) -> tuple[Array, Array]:
    """Return (F,) how far (sizes) the free parts sink while the hand waits, and how fast (sizes/s) they then move.

    The hand is where the way along the cone's axis starts; its part counts as resting.
    """
    import mujoco

    compiled, way = ready.compiled, ready.cone.axis
    far = reach(compiled.scene.assembly)[compiled.parts]
    below = compiled.parts != ready.cone.part
    offset = np.zeros(compiled.dof.shape[1])
    path = HandPath(compiled.model, compiled, ready.cone.part, way, legs=((ready.travel(way, hand), 1),), offset=offset)
    data = mujoco.MjData(compiled.model)
    path.place(data)
    mujoco.mj_forward(compiled.model, data)
    start = data.qpos.copy()
    data.ctrl[:] = path.commands[0]
    let_go_gently(compiled.model, data, ready.gentle_steps(hand), ready.below_dof)
    for _ in range(round(SETTLING_STEPS * ready.finer) // LOOK):
        mujoco.mj_step(compiled.model, data, LOOK)
        sunk, speed = (
            np.where(below, x / (2.0 * far), 0.0) for x in displacement_and_speed(compiled, data, start, far)
        )
        if (speed <= RESTS).all():
            break
    return sunk, speed


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
    graph: PartsGraph,
    part: int,
    clearance: float,
    below: str = "held",
    resting: ContactModel | None = None,
) -> ContactModel:
    """Return the contact model that stays true while `part`, smaller by `clearance`, travels; see `trial_scene`."""
    assembly, contacts = graph.assembly, graph.contacts
    if assembly.dimension == 2:
        return flat_pieces(assembly, resting_model(assembly, contacts) if resting is None else resting, part, clearance)
    if below == "held":
        return solid_pieces(contacts, part, clearance)
    earlier = np.arange(len(assembly.parts)) < part
    resting = resting_model(assembly, [c for c in contacts if c.parts[1] < part]) if resting is None else resting
    return solid_pieces(contacts, part, clearance, resting.only(earlier))
