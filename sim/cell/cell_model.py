"""A robot cell at one moment of a build, as a MuJoCo model.

The world's frame is the structure's own (flat designs stand in its x–z plane). A build is a row of such moments:

`fetch`: one part leaves its nest and travels; what is built stands still, for nothing touches it.
`insert`: the part meets its neighbours with its real outline, and those are free to give way.
`rest`: the part has been let go; every joint carries by the facet pairs that states are judged with elsewhere.

Collisions of parts with each other are explicit pairs only (see `sim.shapes.contact_model`); arm, hand, pads
and table meet the parts' outer surfaces by collision bits.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.contacts.contact import Contact
from mocca_robot.geometry.extrusion import surface
from planners.robot.arm_bodies import add_obstacle
from planners.robot.cell import RobotCell
from planners.robot.site import Site
from planners.robot.tool import SuctionGripper
from sim.cell.arm_model import ARM, PAD, PART, add_arm, add_cup
from sim.cell.weld import soften
from sim.heard import listen
from sim.scene import add_shape
from sim.settings import Settings, settings_for
from sim.shapes.contact_model import ContactModel, Geom, embed, facets, geom, pieces
from sim.shapes.inertia import inertia
from sim.shapes.solid_pieces import solid_pieces

SOFT_WIDTH_M = 1e-3
"""Depth over which the nest's contact becomes as hard as it gets."""

Phase = Literal["fetch", "insert", "rest"]

TRAVEL_STEP = 2.0
"""While nothing touches the structure, steps are this much longer."""
ACROSS = 0.3
"""Friction across the plane of flat parts, whatever it is within: their joints say nothing about that direction, and
without any the structure would drift apart like cards."""
LEAST_FRICTION = 1e-5
GRIP_IMPRATIO = 100.0
"""Friction this much stiffer than normal contact: at 10 a part turns by 7° between the fingers in half a minute."""
LAYERS = 0.8
"""Flat parts touch at two depths, this share of the thinner one's thickness apart: so they do not topple out of their
plane."""
SUPPORT_N_M = 2.5e4
"""How stiffly a support holds a part: as an arm holds it, which gives 0.4 mm under 10 N."""
SUPPORT_SPREAD = 0.25
"""Of a part's size: so far from its middle its support holds it, as to turning."""
MOVING, POINT = 8, 16
"""Further collision bits: the outer surface of a travelling solid, and the points of its joints."""


@dataclass(frozen=True)
class Pose:
    """Where a part's frame is: its centre of mass, and a quaternion, w first; world frame."""

    position: tuple[float, float, float]
    quat_wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Workplace:
    """All that stays the same during a build.

    Attributes:
        assembly: at its size in the cell.
        contacts: of the finished structure.
        turn, shift: base-frame point = turn (3, 3) @ world point + shift (3,).
        skins: per part, shapes that arm, pads and table meet.
        plinth: (2, 3) corners of what carries the fixed parts above the table, base frame; None on the table itself.
        friction: within joints; 0 leaves everything to their shape.
        pad_friction: between pads and parts.
    """

    cell: RobotCell
    assembly: Assembly
    contacts: tuple[Contact, ...]
    turn: Array
    shift: Array
    skins: tuple[tuple[Geom, ...], ...]
    plinth: Array | None
    friction: float
    pad_friction: float


@dataclass(frozen=True)
class Moment:
    """One moment of a build, by part indices: what travels, what is built and free, what is built and held.

    `yielding` are parts whose supports give way to what is pushed in beside them, and where these took them over.
    """

    phase: Phase
    moving: int | None
    free: tuple[int, ...]
    held: tuple[int, ...]
    yielding: tuple[tuple[int, Pose], ...] = ()

    @property
    def loose(self) -> tuple[int, ...]:
        """Return the parts that can move."""
        still = self.free if self.phase != "fetch" else ()
        return (*still, *(k for k, _ in self.yielding), *(() if self.moving is None else (self.moving,)))


def workplace(
    cell: RobotCell, where: Site, contacts: Sequence[Contact], friction: float, pad_friction: float
) -> Workplace:
    """Return the place where the structure of `where` is built; `contacts` are its own, at its size there."""
    turn = np.asarray(where.turn)
    if turn.shape[1] == 2:
        turn = np.column_stack([turn[:, 0], np.cross(turn[:, 1], turn[:, 0]), turn[:, 1]])
    shift = np.asarray(where.shift)
    if where.assembly.dimension == 2:
        prisms = pieces(where.assembly).geoms
        skins = tuple(tuple(g for g in prisms if g.part == k) for k in range(len(where.assembly.parts)))
    else:
        skins = tuple(
            tuple(geom(k, "convex", (piece - shift) @ turn, np.zeros(3)) for piece in body.pieces)
            for k, body in enumerate(where.bodies)
        )
    return Workplace(
        cell=cell,
        assembly=where.assembly,
        contacts=tuple(contacts),
        turn=turn,
        shift=shift,
        skins=skins,
        plinth=where.plinth,
        friction=friction,
        pad_friction=pad_friction,
    )


def seat(part: Part) -> Pose:
    """Return where a part belongs."""
    x, y, z = embed(part.centroid).tolist()
    return Pose((x, y, z))


def compile_moment(place: Workplace, moment: Moment, poses: Mapping[int, Pose]) -> Any:
    """Return the mujoco.MjModel of a moment; `poses` by part index, of every part that is to be there.

    Coordinates: six joints, two fingers, then a free joint per part that can move, in the order of part indices.
    """
    import mujoco

    listen()
    settings = settings_for(place.assembly, place.friction, len(moment.free) + len(moment.yielding) + 1)
    spec = mujoco.MjSpec()
    _options(spec, settings, TRAVEL_STEP if moment.phase == "fetch" else 1.0)
    base = place.turn.T @ -place.shift
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(place.turn.T).ravel())
    add_arm(spec, place.cell, base, quat, place.pad_friction)
    _add_table(spec, place, base, quat)
    bodies = {k: _add_part(spec, place, k, poses[k], moment) for k in sorted(poses)}
    built = {*moment.free, *moment.held, *(k for k, _ in moment.yielding)}
    if moment.phase == "fetch":
        if moment.moving is not None and place.assembly.dimension == 2:
            _pair_skins(spec, place, moment.moving, built, settings)
    else:
        _add_joints(spec, place, moment, built, bodies, settings)
    if moment.moving is not None:
        name = place.assembly.parts[moment.moving].name
        if moment.phase == "fetch":
            _add_nest(spec, name, poses[moment.moving])
        if isinstance(place.cell.gripper, SuctionGripper):
            add_cup(spec, f"part {name}")
    for k, pose in moment.yielding:
        _add_weld(spec, f"support {k}", f"part {place.assembly.parts[k].name}", pose)
    model = spec.compile()
    for k, _ in moment.yielding:
        size = float(np.linalg.norm(np.ptp(place.assembly.parts[k].shape.bounds, axis=0)))
        soften(model, int(model.equality(f"support {k}").id), SUPPORT_N_M, SUPPORT_N_M * (SUPPORT_SPREAD * size) ** 2)
    return model


def _options(spec: Any, settings: Settings, longer: float) -> None:
    import mujoco

    option = spec.option
    option.timestep = settings.timestep * longer
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.iterations, option.tolerance, option.ls_iterations = settings.iterations, settings.tolerance, 100
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = GRIP_IMPRATIO
    option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE if settings.sparse else mujoco.mjtJacobian.mjJAC_DENSE
    if hasattr(mujoco.mjtEnableBit, "mjENBL_MULTICCD"):
        option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_MULTICCD)
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    spec.compiler.autolimits = True
    spec.compiler.balanceinertia = True
    spec.memory = 64 << 20


def _add_table(spec: Any, place: Workplace, base: Array, quat: Array) -> None:
    import mujoco

    table = spec.worldbody.add_body(name="table", pos=base, quat=quat)
    for name, corners in (("table", place.cell.table_m), ("plinth", place.plinth)):
        if corners is None:
            continue
        table.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=0.5 * (corners[0] + corners[1]),
            size=0.5 * (corners[1] - corners[0]),
            contype=0,
            conaffinity=ARM | PAD | PART,
            condim=3,
        )
    for obstacle in place.cell.obstacles:
        add_obstacle(table, obstacle, contype=0, conaffinity=ARM | PAD | PART, condim=3)


def _add_part(spec: Any, place: Workplace, index: int, pose: Pose, moment: Moment) -> Any:
    import mujoco

    part, moving, waits = place.assembly.parts[index], index == moment.moving, moment.phase == "fetch"
    body = spec.worldbody.add_body(name=f"part {part.name}", pos=pose.position, quat=pose.quat_wxyz)
    if index in moment.loose:
        tensor = inertia(Part(part.name, surface(part), part.density, part.fixed))
        body.explicitinertial, body.mass, body.ipos = True, part.mass, np.zeros(3)
        body.fullinertia = [tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2]]
        body.add_freejoint(name=f"part {part.name}")
        # Its nest carries it until the fingers do, or its support where that took it over.
        carried = (moving and waits) or index in dict(moment.yielding)
        body.gravcomp = 1.0 if carried else 0.0
    centre = embed(part.centroid)
    travels = moving and waits and place.assembly.dimension == 3
    for n, skin in enumerate(place.skins[index]):
        name = f"skin {part.name} {n}"
        mesh = spec.add_mesh(name=name, uservert=(skin.points - centre).ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        body.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            mass=0.0,
            contype=(PART | MOVING) if travels else PART,
            conaffinity=ARM | PAD | (0 if moving else MOVING),
            condim=3,
        )
    return body


def _add_nest(spec: Any, name: str, pose: Pose) -> None:
    """Hold a part where it waits, gently enough for the fingers to centre it."""
    nest = _add_weld(spec, "nest", f"part {name}", pose)
    nest.data[10] = 0.01
    nest.solref, nest.solimp = (0.03, 1.0), (0.9, 0.9, SOFT_WIDTH_M, 0.5, 2.0)


def _add_weld(spec: Any, name: str, body: str, pose: Pose) -> Any:
    import mujoco

    weld = spec.add_equality(name=name, type=mujoco.mjtEq.mjEQ_WELD)
    weld.name1, weld.name2 = "world", body
    weld.objtype = mujoco.mjtObj.mjOBJ_BODY
    # data: anchor in the second body, pose of the second in the first, torque scale.
    weld.data[:11] = [0.0, 0.0, 0.0, *pose.position, *pose.quat_wxyz, 1.0]
    return weld


def _pair_skins(spec: Any, place: Workplace, moving: int, others: Iterable[int], settings: Settings) -> None:
    """Let the outlines of a travelling flat part meet those of all others."""
    mine = place.assembly.parts[moving].name
    for other in others:
        theirs = place.assembly.parts[other].name
        for a in range(len(place.skins[moving])):
            for b in range(len(place.skins[other])):
                _pair(spec, place, settings, f"skin {mine} {a}", f"skin {theirs} {b}")


def _add_joints(
    spec: Any, place: Workplace, moment: Moment, built: set[int], bodies: Mapping[int, Any], settings: Settings
) -> None:
    """Add what the parts carry each other by: facet pairs of those at rest, and the way in of the one that moves.

    Parts that cannot move need none between them.
    """
    moving, assembly, loose = moment.moving, place.assembly, set(moment.loose)
    there = built if moving is None else {*built, moving}
    met = [c for c in place.contacts if set(c.parts) <= there and loose & set(c.parts)]
    if moving is None or moment.phase == "rest":
        model = _deep(assembly, facets(met))
    elif assembly.dimension == 2:
        model = _deep(assembly, facets([c for c in met if moving not in c.parts]))
        _pair_skins(spec, place, moving, built, settings)
    else:
        model = solid_pieces(met, moving, others=facets([c for c in met if c.parts[1] < moving]))
    names = [_add_geom(spec, assembly, bodies[g.part], k, g, settings) for k, g in enumerate(model.geoms)]
    for a, b in model.pairs or ():
        _pair(spec, place, settings, names[a], names[b])


def _deep(assembly: Assembly, model: ContactModel) -> ContactModel:
    """Return facet pairs of flat parts at two depths, both inside the thinner part; those of solids as they are."""
    if assembly.dimension == 3:
        return model
    thin = [_thickness(assembly.parts[g.part]) for g in model.geoms]
    for a, b in model.pairs or ():
        thin[a] = thin[b] = min(thin[a], thin[b])
    geoms: list[Geom] = []
    for sign in (-0.5, 0.5):
        for k, g in enumerate(model.geoms):
            depth = sign * LAYERS * thin[k]
            geoms.append(geom(g.part, g.kind, g.points + np.array([0.0, depth, 0.0]), g.size, g.rotation, g.role))
    count = len(model.geoms)
    pairs = [(a + k * count, b + k * count) for k in (0, 1) for a, b in model.pairs or ()]
    return ContactModel(tuple(geoms), tuple(pairs))


def _thickness(part: Part) -> float:
    assert isinstance(part.shape, Polygon)
    return part.shape.thickness


def _add_geom(spec: Any, assembly: Assembly, body: Any, number: int, shape: Geom, settings: Settings) -> str:
    contype, conaffinity = {"any": (0, 0), "point": (POINT, 0), "face": (0, POINT)}[shape.role]
    collides = {"contype": contype, "conaffinity": conaffinity, "group": 4}
    centre = embed(assembly.parts[shape.part].centroid)
    return add_shape(spec, body, shape, f"joint {number}", centre, settings, **collides)


def _pair(spec: Any, place: Workplace, settings: Settings, first: str, second: str) -> None:
    """Let two shapes meet. MuJoCo's first tangent is the world's y wherever the normal has none: across flat parts."""
    flat = place.assembly.dimension == 2
    within = max(place.friction, LEAST_FRICTION)
    across = max(ACROSS, place.friction) if flat else within
    spec.add_pair(
        geomname1=first,
        geomname2=second,
        condim=3 if flat or place.friction > 0.0 else 1,
        friction=[across, within, 0.0, 0.0, 0.0],
        solref=settings.solref,
        solimp=settings.solimp,
    )
