"""Load cases of strength: what acts on every part, contacts, weight and user loads, in balance with one another."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mocca_robot.actions import Combination
from mocca_robot.arrays import Array, BoolArray, IntArray, read_only
from mocca_robot.assembly import Mesh, Part, Polygon
from mocca_robot.errors import InputError
from mocca_robot.geometry.cones import cross
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.applied import applied_forces
from mocca_robot.statics.loads import LoadCase, load_cases, state_cases
from mocca_robot.strength.bedding import Bed, Pressed, pressed
from mocca_robot.strength.options import StrengthOptions
from mocca_robot.strength.settings import TINY

PATCH = 1.0 / 12.0
"""Lines and pressed faces come in pieces of this share of the assembly's size divided by the root of the parts."""


GROWTH = {"force": -2, "mass": -2, "worker": -2, "line": -1, "pressure": 0, "wind": 0}
"""With which power of the size the stress of a load grows that keeps its own size."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Question:
    """A load case whose strength is asked.

    Attributes:
        case: the load case; user loads are among its applied wrenches, too.
        further: part, force (d,) and point (d,) of every piece of a user load.
        required: whether a user asked for it, so that it has to be in equilibrium.
    """

    case: LoadCase
    further: tuple[tuple[int, Array, Array], ...] = ()
    required: bool = True


@dataclass(frozen=True, eq=False, kw_only=True)
class PartLoads:
    """All that acts on one part in one load case.

    Attributes:
        part: index.
        case: the load case's name.
        points, forces: (S, d) contact samples and newtons on this part.
        normals: (S, d) out of this part.
        areas: (S,) m².
        beside: (S,) the neighbour.
        further: (L, d) points and (L, d) newtons of user loads.
        gravity: (d,) m/s².
    """

    part: int
    case: str
    points: Array
    forces: Array
    normals: Array
    areas: Array
    beside: IntArray
    further: tuple[Array, Array]
    gravity: Array

    @property
    def pressure(self) -> Array:
        """Return (S,) pascals, across the contact."""
        return np.asarray(-np.einsum("sd,sd->s", self.forces, self.normals) / self.areas)

    def among(self, kept: BoolArray) -> PartLoads:
        """Return the same with some of the contact samples only."""
        names = ("points", "forces", "normals", "areas", "beside")
        return replace(self, **{name: getattr(self, name)[kept] for name in names})

    def unbalanced(self, mass: float, centre: Array) -> float:
        """Return what is left of forces and moments about the centre of mass, as a share of what acts."""
        points = np.concatenate([self.points, self.further[0], centre[None]]) - centre
        forces = np.concatenate([self.forces, self.further[1], mass * self.gravity[None]])
        size = float(np.linalg.norm(np.ptp(self.points, axis=0))) if len(self.points) else 0.0
        size = size or float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
        acting = float(np.linalg.norm(forces, axis=1).sum())
        turn = float(np.linalg.norm(cross(points, forces).sum(axis=0))) / size
        return max(float(np.linalg.norm(forces.sum(axis=0))), turn) / max(acting, TINY)


def questions(
    graph: PartsGraph, options: StrengthOptions, *, states: bool = True, scale: float = 1.0
) -> tuple[Question, ...]:
    """Return the load cases of the goals and the user's combinations, then states of the sequence and insertions.

    With `scale` they are those of an assembly so many times as large, told for the one at hand: with the same stresses
    there. Weight grows with it, forces fall with its square, lines with it, pressures stay.

    Cases without weight (interlocking) have no size, so nothing can be said about strength there.
    """
    found = [_question(graph, c, scale) for c in load_cases(graph) if c.gravity is not None]
    known = {q.case.name for q in found}
    if states:
        last = len(graph.free)
        for number, case in enumerate(state_cases(graph)):
            if case.name not in known and not ("gravity" in known and number == last - 1):
                found.append(Question(case=_heavier(case, scale), required=False))
    if options.insertion_force > 0.0:
        found += [_pushed(graph, part, options.insertion_force / scale**2, scale) for part in graph.free]
    return tuple(found)


def _heavier(case: LoadCase, scale: float) -> LoadCase:
    assert case.gravity is not None
    return case if scale == 1.0 else replace(case, gravity=read_only(scale * case.gravity))


def _question(graph: PartsGraph, case: LoadCase, scale: float) -> Question:
    case = _heavier(case, scale)
    if case.applied is None:
        return Question(case=case)
    combination, state = _combination(graph, case)
    cell = PATCH * graph.assembly.size / np.sqrt(max(len(graph.assembly.parts), 1))
    factors = combination.factors
    pieces = [
        (part, factors[action.name] * scale ** GROWTH[action.kind] * force, point)
        for action in graph.assembly.actions
        if action.name in factors
        for part, force, point in applied_forces(state, action, float(cell))
    ]
    if scale != 1.0:
        applied = np.zeros((len(graph.assembly.parts), graph.assembly.dof))
        for part, force, point in pieces:
            applied[part] += np.concatenate([force, cross(point, force)])
        case = replace(case, applied=read_only(applied))
    return Question(case=case, further=tuple(pieces))


def _combination(graph: PartsGraph, case: LoadCase) -> tuple[Combination, PartsGraph]:
    for combination in graph.assembly.combinations:
        if case.name == f"load_{combination.name}":
            return combination, graph
        for part, state in graph.states.items():
            if case.name == f"load_{combination.name}_state_{graph.assembly.parts[part].name}":
                return combination, state
    raise ValueError(case.name)


def _pushed(graph: PartsGraph, part: int, force: float, scale: float) -> Question:
    """Return the state just after placing a part, while it is still pushed along its way in."""
    assembly = graph.assembly
    state = graph.state(part)
    push = force * np.asarray(graph.placed(part).direction)
    point = assembly.parts[part].centroid
    applied = np.zeros((len(assembly.parts), assembly.dof))
    applied[part] = np.concatenate([push, cross(point, push)])
    name = f"insertion_{assembly.parts[part].name}"
    case = LoadCase(name, read_only(scale * assembly.gravity), state.present, assembly.fixed, read_only(applied))
    return Question(case=case, further=((part, push, point),), required=False)


def answered(bed: Bed, graph: PartsGraph, asked: Question, friction: float = 0.0) -> tuple[PartLoads, ...] | None:
    """Return what acts on every free part that is there; None where a case that nobody required does not balance.

    Raises InputError for a required load case that is not in equilibrium.
    """
    found = pressed(bed, graph, asked.case, friction)
    if not found.balanced:
        if asked.required:
            raise InputError(
                f"The load case '{asked.case.name.removeprefix('load_')}' is not in equilibrium ({found.left:.1g} of "
                "it is left over), and strength needs one: `mocca-robot check` says what moves, `mocca-robot design` "
                "finds joints that hold it; then give `mocca-robot strength` the folder of that design."
            )
        return None
    return tuple(_on(bed, found, graph, asked, int(part)) for part in np.flatnonzero(asked.case.free))


def _on(bed: Bed, found: Pressed, graph: PartsGraph, asked: Question, part: int) -> PartLoads:
    d = graph.assembly.dimension
    mine = bed.of_part[part]
    mine = mine[asked.case.present[bed.pairs[mine]].all(axis=1)]
    pieces = [(force, point) for p, force, point in asked.further if p == part]
    assert asked.case.gravity is not None
    return replace(
        untouched(bed, part, mine),
        case=asked.case.name,
        forces=np.where(bed.pairs[mine, 1] == part, 1.0, -1.0)[:, None] * found.forces[mine],
        further=(
            np.array([p for _, p in pieces]).reshape(-1, d),
            np.array([f for f, _ in pieces]).reshape(-1, d),
        ),
        gravity=asked.case.gravity,
    )


def untouched(bed: Bed, part: int, samples: IntArray | None = None) -> PartLoads:
    """Return a part's contacts, all or `samples` of the bed, with nothing acting on them."""
    mine = bed.of_part[part] if samples is None else samples
    second = bed.pairs[mine, 1] == part
    points = bed.points[mine]
    none = np.zeros((0, points.shape[1]))
    return PartLoads(
        part=part,
        case="",
        points=points,
        forces=np.zeros_like(points),
        normals=np.where(second, -1.0, 1.0)[:, None] * bed.normals[mine],
        areas=bed.areas[mine],
        beside=np.where(second, bed.pairs[mine, 0], bed.pairs[mine, 1]),
        further=(none, none),
        gravity=np.zeros(points.shape[1]),
    )


def gripped(bed: Bed, graph: PartsGraph, part: int, force: float) -> PartLoads:
    """Return a part that hangs in a gripper: two pads press on it where it is narrowest through its centre of mass."""
    assembly = graph.assembly
    body = assembly.parts[part]
    axis, ends = _narrowest(body)
    reach = np.linalg.norm(ends - body.centroid, axis=1)
    held = -body.mass * assembly.gravity * (reach[::-1] / max(float(reach.sum()), TINY))[:, None]
    forces = force * np.stack([axis, -axis]) + held
    return replace(
        untouched(bed, part, np.zeros(0, dtype=np.int64)),
        case=f"grip_{body.name}",
        further=(ends, forces),
        gravity=assembly.gravity,
    )


def _narrowest(part: Part) -> tuple[Array, Array]:
    """Return a unit axis (d,) through the centroid and where it leaves the part (2, d), the nearest together."""
    centre = part.centroid
    angles = np.pi * np.arange(24) / 24
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    if isinstance(part.shape, Mesh):
        ways = np.column_stack([ways, np.zeros(24)])  # a gripper comes from above: its jaws close level
    reach = np.array([[_exit(part.shape, centre, w), _exit(part.shape, centre, -w)] for w in ways])
    best = int(reach.sum(axis=1).argmin())
    return ways[best], np.stack([centre - reach[best, 1] * ways[best], centre + reach[best, 0] * ways[best]])


def _exit(shape: Polygon | Mesh, start: Array, way: Array) -> float:
    """Return how far it is from a place to where a ray last leaves a shape."""
    if isinstance(shape, Polygon):
        a, b = shape.exterior, np.roll(shape.exterior, -1, axis=0)
        span, gap = b - a, a - start
        det = way[0] * span[:, 1] - way[1] * span[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            far = (gap[:, 0] * span[:, 1] - gap[:, 1] * span[:, 0]) / det
            share = (gap[:, 0] * way[1] - gap[:, 1] * way[0]) / det
        met = (far > 0.0) & (share >= 0.0) & (share <= 1.0)
        return float(far[met].max(initial=0.0))
    corners = shape.vertices[shape.faces]
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(way, edge2)
    det = (p * edge1).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = start - corners[:, 0]
        u = (s * p).sum(axis=1) / det
        q = np.cross(s, edge1)
        v = (q @ way) / det
        t = (q * edge2).sum(axis=1) / det
        met = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0)
    return float(t[met].max(initial=0.0))
