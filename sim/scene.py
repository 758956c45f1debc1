"""An assembly as a MuJoCo model: pure, and inspectable before anything moves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mocca_robot.arrays import Array, BoolArray, read_only
from mocca_robot.assembly import Assembly
from mocca_robot.errors import InputError
from mocca_robot.statics.applied import Push
from sim.heard import listen
from sim.settings import Settings
from sim.shapes.body_order import body_order
from sim.shapes.contact_model import ContactModel, Geom, embed
from sim.shapes.inertia import inertia

MEMORY_LIMIT = 4 << 30
"""Bytes above which a model is refused before compiling."""


@dataclass(frozen=True, eq=False)
class PushingHand:
    """A compliant hand that drives one part.

    Attributes:
        part: index of the driven part; its weight is carried by the hand.
        stiffness: N/m of the hand's three translations.
        turning: N·m/rad of its rotations.
    """

    part: int
    stiffness: float
    turning: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """Everything that decides a MuJoCo model.

    Attributes:
        assembly: parts where they belong in the finished structure.
        contact_model: shapes and pairs, of all parts.
        present: (N,) parts that are there.
        held: (N,) parts that do not move.
        gravity: (d,) as the structure feels it, m/s².
        settings: solver and friction.
        hand: drives a part; None when all parts are left alone.
        pushes: forces of loads on parts where they belong, see `sim.forces`.
    """

    assembly: Assembly
    contact_model: ContactModel
    present: BoolArray
    held: BoolArray
    gravity: Array
    settings: Settings
    hand: PushingHand | None = None
    pushes: tuple[Push, ...] = ()

    @property
    def free(self) -> BoolArray:
        """Return (N,) parts that are there and can move."""
        return np.asarray(self.present & ~self.held)


@dataclass(frozen=True)
class SizePrediction:
    """How large a model will be, estimated without building it."""

    bodies: int
    geoms: int
    contacts: int
    memory_bytes: int


@dataclass(frozen=True, eq=False)
class Compiled:
    """A scene ready to step.

    Attributes:
        scene: what it was made from.
        model: mujoco.MjModel; share it between threads, but never change it (see `with_gravity`).
        parts: (F,) indices of the free parts, in the order of their joints.
        qpos, dof: (F, 3 | 7) and (F, 3 | 6) addresses of their coordinates and velocities.
    """

    scene: Scene
    model: Any
    parts: Array
    qpos: Array
    dof: Array


def predict(scene: Scene) -> SizePrediction:
    """Return the size of the model that `scene` will become."""
    model = scene.contact_model.only(scene.present)
    convex = sum(g.kind == "convex" for g in model.geoms)
    contacts = len(_pairs(scene, model)) + 8 * convex
    dofs = scene.assembly.dof * int(scene.free.sum())
    # Per contact: 0.6 kB of itself, condim rows over two bodies; per body the sparse factor's fill.
    rows = contacts * scene.settings.condim
    memory = 600 * contacts + 24 * rows * 2 * scene.assembly.dof + 8 * dofs * min(dofs, 400) + 2000 * len(model.geoms)
    return SizePrediction(int(scene.present.sum()) + 1, len(model.geoms), contacts, 4 * memory + (1 << 20))


def spec(scene: Scene) -> Any:
    """Return the mujoco.MjSpec of `scene`: one body per part that is there, named after it.

    Raises InputError for a part without mass and for a model that would not fit into memory.
    """
    import mujoco

    size = predict(scene)
    if size.memory_bytes > MEMORY_LIMIT:
        raise InputError(
            f"'{scene.assembly.name}' needs about {size.memory_bytes / 2**30:.1f} GB in MuJoCo ({size.geoms} shapes, "
            f"{size.contacts} contacts; limit {MEMORY_LIMIT / 2**30:.0f} GB); simulate fewer parts or lower the "
            "contact resolution."
        )
    out = mujoco.MjSpec()
    out.modelname = scene.assembly.name
    _set_options(out, scene)
    out.memory = size.memory_bytes
    present = scene.contact_model.only(scene.present)
    # The matrix of few parts is dense, whatever their order.
    free = body_order(present, scene.free) if scene.settings.sparse else np.flatnonzero(scene.free)
    held = np.flatnonzero(scene.present & scene.held)
    bodies = {int(k): _body(out, scene, int(k)) for k in (*held, *free)}
    names = [_geom(out, scene, bodies[g.part], k, g) for k, g in enumerate(present.geoms)]
    for a, b in _pairs(scene, present):
        # Points only: between meshes a margin makes contacts that are not there.
        margin = scene.settings.margin if present.geoms[b].kind == "sphere" else 0.0
        _pair(out, scene, names[a], names[b], margin)
    if scene.hand is not None:
        _actuators(out, scene)
    return out


def compile_scene(scene: Scene) -> Compiled:
    """Return the compiled model of `scene` with the addresses of its free parts."""
    listen()
    model = spec(scene).compile()
    parts = np.flatnonzero(scene.free)
    first = [model.body(scene.assembly.parts[p].name) for p in parts]
    joints = [int(b.jntadr[0]) for b in first]
    quaternion = [model.jnt_type[j] == 0 for j in joints]
    wide = 3 if scene.assembly.dimension == 2 else 6
    span = [7 if q else wide for q in quaternion]
    qpos = np.full((len(parts), 7 if wide == 6 else 3), -1)
    for row, (joint, n) in enumerate(zip(joints, span)):
        qpos[row, :n] = int(model.jnt_qposadr[joint]) + np.arange(n)
    dof = np.array([int(model.jnt_dofadr[j]) + np.arange(wide) for j in joints]).reshape(len(parts), wide)
    return Compiled(scene, model, read_only(parts, np.int64), read_only(qpos, np.int64), read_only(dof, np.int64))


def with_gravity(compiled: Compiled, gravity: Array, pushes: tuple[Push, ...] = ()) -> Compiled:
    """Return the same model under another gravity (d,) and the forces of loads; nothing is compiled again."""
    import copy

    model = copy.copy(compiled.model)
    model.opt.gravity[:] = embed(np.asarray(gravity))
    scene = replace(compiled.scene, gravity=gravity, pushes=pushes)
    return Compiled(scene, model, compiled.parts, compiled.qpos, compiled.dof)


def with_timestep(compiled: Compiled, timestep: float) -> Compiled:
    """Return the same model with another step (s) and contacts stiffer or softer in proportion to its square."""
    import copy

    scene = replace(compiled.scene, settings=replace(compiled.scene.settings, timestep=timestep))
    model = copy.copy(compiled.model)
    model.opt.timestep = timestep
    model.geom_solref[:] = scene.settings.solref
    model.pair_solref[:] = scene.settings.solref
    model.pair_margin[model.pair_margin > 0.0] = scene.settings.margin
    return Compiled(scene, model, compiled.parts, compiled.qpos, compiled.dof)


def _pairs(scene: Scene, model: ContactModel) -> list[tuple[int, int]]:
    """Return the explicit pairs of `model`'s shapes that can meet.

    MuJoCo collides what is paired even where neither can move: among held parts most of a step.
    """
    held = [scene.held[g.part] for g in model.geoms]
    return [(a, b) for a, b in model.pairs or () if not (held[a] and held[b])]


def _set_options(out: Any, scene: Scene) -> None:
    import mujoco

    s, option = scene.settings, out.option
    option.timestep = s.timestep
    option.gravity = embed(np.asarray(scene.gravity))
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.iterations, option.tolerance = s.iterations, s.tolerance
    option.ls_iterations = 100
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = s.impratio if s.friction > 0 else 1.0
    jacobian = mujoco.mjtJacobian
    option.jacobian = jacobian.mjJAC_SPARSE if s.sparse else jacobian.mjJAC_DENSE
    # Without several contact points per pair of faces, blocks rest on single points; see mjDSBL_MULTICCD, an
    # enable flag before it became the default.
    option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    if hasattr(mujoco.mjtEnableBit, "mjENBL_MULTICCD"):
        option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_MULTICCD)
    # Resetting by itself would hide that a run exploded.
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    out.compiler.autolimits = True
    # Principal axes of nearly flat inertias round below the triangle inequality.
    out.compiler.balanceinertia = True


def _body(out: Any, scene: Scene, index: int) -> Any:
    import mujoco

    part = scene.assembly.parts[index]
    body = out.worldbody.add_body(name=part.name, pos=embed(part.centroid))
    if scene.held[index]:
        return body
    if not part.mass > 0.0:
        raise InputError(f"Part '{part.name}' has mass {part.mass:.3g} kg; give it a positive density.")
    tensor = inertia(part)
    body.explicitinertial = True
    body.mass = part.mass
    body.ipos = np.zeros(3)
    body.fullinertia = [tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2]]
    driven = scene.hand is not None and scene.hand.part == index
    if driven:
        body.gravcomp = 1.0
    if scene.assembly.dimension == 3 and not driven:
        body.add_freejoint(name=part.name)
        return body
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    for label, kind, axis in _planar_axes(slide, hinge) if scene.assembly.dimension == 2 else _axes(slide, hinge):
        body.add_joint(name=f"{part.name}/{label}", type=kind, axis=axis)
    return body


def _planar_axes(slide: Any, hinge: Any) -> list[tuple[str, Any, list[float]]]:
    # A counter-clockwise turn in the x–y plane of the drawing is one about −y where z is up.
    return [("x", slide, [1, 0, 0]), ("y", slide, [0, 0, 1]), ("turn", hinge, [0, -1, 0])]


def _axes(slide: Any, hinge: Any) -> list[tuple[str, Any, list[float]]]:
    unit = np.eye(3).tolist()
    return [(f"{n}{a}", k, unit[i]) for n, k in (("", slide), ("turn_", hinge)) for i, a in enumerate("xyz")]


def _geom(out: Any, scene: Scene, body: Any, number: int, geom: Geom) -> str:
    collides: dict[str, int] = {}
    if geom.role != "any" or scene.contact_model.pairs is not None:
        contype, conaffinity = {"any": (0, 0), "point": (2, 4), "face": (4, 2)}[geom.role]
        collides = {"contype": contype, "conaffinity": conaffinity}
    centre = embed(scene.assembly.parts[geom.part].centroid)
    return add_shape(out, body, geom, f"{body.name}/{number}", centre, scene.settings, **collides)


def add_shape(spec: Any, body: Any, shape: Geom, name: str, centre: Array, settings: Settings, **further: int) -> str:
    """Add a shape without mass to the body that turns about `centre` (3,), and return its name.

    `further` are more attributes of MuJoCo's geom: what it may collide with, its group.
    """
    import mujoco

    common: dict[str, Any] = {
        "name": name,
        "mass": 0.0,
        "condim": settings.condim,
        "friction": [settings.friction, 0.0, 0.0],
        "solref": settings.solref,
        "solimp": settings.solimp,
        **further,
    }
    if shape.kind == "convex":
        mesh = spec.add_mesh(name=name)
        mesh.uservert = (shape.points - centre).ravel()
        # Thin slivers have no volume worth the name; masses are given explicitly anyway.
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **common)
        return name
    kind = mujoco.mjtGeom.mjGEOM_SPHERE if shape.kind == "sphere" else mujoco.mjtGeom.mjGEOM_BOX
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, shape.rotation.ravel())
    body.add_geom(type=kind, pos=shape.points[0] - centre, quat=quaternion, size=shape.size, **common)
    return name


def _pair(out: Any, scene: Scene, first: str, second: str, margin: float) -> None:
    s = scene.settings
    out.add_pair(
        geomname1=first,
        geomname2=second,
        condim=s.condim,
        friction=[s.friction, s.friction, 0.0, 0.0, 0.0],
        solref=s.solref,
        solimp=s.solimp,
        margin=margin,
    )


def _actuators(out: Any, scene: Scene) -> None:
    """Servos on the driven part, critically damped; see `sim.insertion.trial` for the path they follow."""
    assert scene.hand is not None
    hand, part = scene.hand, scene.assembly.parts[scene.hand.part]
    moment = float(np.trace(inertia(part))) / 3.0
    for joint in out.body(part.name).joints:
        turning = "turn" in joint.name
        stiffness, mass = (hand.turning, moment) if turning else (hand.stiffness, part.mass)
        actuator = out.add_actuator(name=joint.name, target=joint.name)
        actuator.trntype = _transmission()
        actuator.set_to_position(kp=stiffness, kv=2.0 * np.sqrt(stiffness * mass))


def _transmission() -> Any:
    import mujoco

    return mujoco.mjtTrn.mjTRN_JOINT
