"""A scene set free: how far and how fast each part moves, and whether the run can be believed."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from mocca_robot.arrays import Array, IntArray, read_only
from mocca_robot.assembly import Assembly, Mesh, Polygon
from mocca_robot.errors import MoccaError
from sim.forces import forces_of
from sim.heard import heard
from sim.scene import Compiled
from sim.settings import ENERGY_GROWTH, OVERLAP

LOOK = 20
"""Steps between two looks at what, once wrong, stays wrong."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """One run, sampled.

    Attributes:
        parts: (F,) indices of the free parts.
        times: (T,) seconds.
        poses: (T, F, 3 | 7) joint coordinates: x, y, turn; or position and quaternion (w first).
        displacement: (T, F) bound on how far any point of the part has moved, metres.
        speed: (T, F) bound on how fast any point of it moves, m/s.
        steps: number of steps taken.
        failure: why the run must not be believed; None when it may.
    """

    parts: Array
    times: Array
    poses: Array
    displacement: Array
    speed: Array
    steps: int
    failure: str | None


Stop: TypeAlias = Callable[[float, Array, Array], bool]
"""(time, displacement (F,), speed (F,)) → whether enough was seen."""


def reach(assembly: Assembly) -> Array:
    """Return (N,) the largest distance of a part's points from its centre of mass, metres."""
    return np.array([np.linalg.norm(_points(p.shape) - p.centroid, axis=1).max() for p in assembly.parts])


class Abandoned(MoccaError):
    """A run was ended from outside; it says nothing."""


abandoned = threading.Event()
"""Set to end all runs of this process at their next look."""


def run(
    compiled: Compiled,
    duration: float,
    stop: Stop | None = None,
    samples: int = 100,
    watch_energy: bool = True,
    gentle_s: float = 0.0,
) -> Motion:
    """Return the motion from rest, ended by `stop`, by `duration` (s), or by a failure.

    For the first `gentle_s` seconds velocities are removed after every step, so that contact forces build up before
    anything is let go: no viscous hand can hold up what does not stand. Without it the first step falls freely, and
    with friction parts then hop: where a contact slides, MuJoCo's convex friction lifts it, and it lands sliding.

    A run fails when parts overlap at the start, when MuJoCo warns, when Newton's method uses up its iterations, when
    energy grows, or when numbers are not finite.
    """
    import mujoco

    model, data = compiled.model, mujoco.MjData(compiled.model)
    far = reach(compiled.scene.assembly)[compiled.parts]
    allowed = ENERGY_GROWTH * _falling_energy(compiled, far)
    planned = max(1, round(duration / model.opt.timestep))
    every = max(1, planned // samples)
    heard()
    mujoco.mj_forward(model, data)
    start, before = data.qpos.copy(), float(data.energy.sum())
    times, poses, moved, speeds = [0.0], [data.qpos[compiled.qpos]], [np.zeros(len(far))], [np.zeros(len(far))]
    failure = overlap(compiled, data)
    gentle = round(gentle_s / model.opt.timestep)
    forces = forces_of(compiled)
    # Views into `data`: asking for them after every step would take as long as a step of a small structure.
    iterations, energy, velocity, most = data.solver_niter, data.energy, data.qvel, model.opt.iterations
    ceiling = before + allowed if watch_energy else np.inf
    step = 0
    for step in range(1, (planned if failure is None else 0) + 1):
        if forces is not None:
            forces.put(data)
        mujoco.mj_step(model, data)
        if forces is not None:
            ceiling += forces.work(data, model.opt.timestep)
        if step <= gentle:
            velocity[:] = 0.0
        grew = energy[0] + energy[1] > ceiling
        # Warnings and numbers that are not finite stay; iterations and energy are those of the last step alone.
        if grew or not step % LOOK or not step % every or iterations.max() >= most:
            failure = step_failure(model, data) or ("energy grew without cause" if grew else None)
        if step % every and failure is None:
            continue
        if abandoned.is_set():
            raise Abandoned("Interrupted before it came to a verdict.")
        displacement, speed = displacement_and_speed(compiled, data, start, far)
        times.append(float(data.time))
        poses.append(data.qpos[compiled.qpos])
        moved.append(displacement)
        speeds.append(speed)
        if failure is not None or (stop is not None and stop(float(data.time), displacement, speed)):
            break
    return Motion(
        parts=compiled.parts,
        times=read_only(times),
        poses=read_only(poses),
        displacement=read_only(moved),
        speed=read_only(speeds),
        steps=step,
        failure=failure,
    )


def let_go_gently(model: Any, data: Any, steps: int, dof: IntArray | None = None) -> None:
    """Take steps and remove the velocities `dof` (default: all) after each; see `run`."""
    import mujoco

    which = slice(None) if dof is None else dof
    for _ in range(steps):
        mujoco.mj_step(model, data)
        data.qvel[which] = 0.0


def overlap(compiled: Compiled, data: Any) -> str | None:
    """Return which parts overlap deepest, when it is by more than `OVERLAP` of the smaller one; else None."""
    if data.ncon == 0:
        return None
    model = compiled.model
    size = np.full(model.nbody, np.inf)
    for part, length in zip(compiled.scene.assembly.parts, 2.0 * reach(compiled.scene.assembly)):
        with contextlib.suppress(KeyError):  # absent in this state
            size[model.body(part.name).id] = length
    bodies = model.geom_bodyid[data.contact.geom]
    share = -data.contact.dist / size[bodies].min(axis=1)
    worst = int(share.argmax())
    if share[worst] <= OVERLAP:
        return None
    first, second = (model.body(int(b)).name for b in bodies[worst])
    return f"'{first}' and '{second}' overlap by {-data.contact.dist[worst] * 1e3:.3g} mm before anything moves"


def step_failure(model: Any, data: Any) -> str | None:
    """Return why the last step must not be believed, or None."""
    islands = max(1, min(int(data.nisland), len(data.solver_niter)))
    if data.solver_niter[:islands].max() >= model.opt.iterations:
        return f"the solver used all {model.opt.iterations} iterations"
    if data.warning.number.any():
        return f"MuJoCo warned: {warnings_of(data)}"
    if messages := heard():
        return f"MuJoCo warned: {'; '.join(messages)}"
    if not np.isfinite(data.qacc).all():
        return "accelerations are not finite"
    return None


def warnings_of(data: Any) -> str:
    """Return the names of MuJoCo's warnings, with how often each came."""
    import mujoco

    counts = [(mujoco.mjtWarning(k).name.removeprefix("mjWARN_").lower(), int(w)) for k, w in _warned(data)]
    return ", ".join(f"{name} ({count}×)" for name, count in counts)


def _warned(data: Any) -> list[tuple[int, int]]:
    return [(k, int(n)) for k, n in enumerate(data.warning.number) if n]


def displacement_and_speed(compiled: Compiled, data: Any, start: Array, far: Array) -> tuple[Array, Array]:
    """Return (F,) bounds on how far (m) any point of each part has moved, and how fast (m/s) it moves.

    `start` are the joint coordinates of the whole model at first, `far` (F,) the parts' reach.
    """
    now, velocity = data.qpos[compiled.qpos], data.qvel[compiled.dof]
    if compiled.qpos.shape[1] == 3:
        shift = now - start[compiled.qpos]
        return (
            np.hypot(shift[:, 0], shift[:, 1]) + far * np.abs(shift[:, 2]),
            np.hypot(velocity[:, 0], velocity[:, 1]) + far * np.abs(velocity[:, 2]),
        )
    shift = np.linalg.norm(now[:, :3] - start[compiled.qpos][:, :3], axis=1)
    angle = 2.0 * np.arctan2(np.linalg.norm(now[:, 4:], axis=1), np.abs(now[:, 3]))
    speed = np.linalg.norm(velocity[:, :3], axis=1) + far * np.linalg.norm(velocity[:, 3:], axis=1)
    return shift + far * angle, speed


def _falling_energy(compiled: Compiled, far: Array) -> float:
    mass = np.array([compiled.scene.assembly.parts[p].mass for p in compiled.parts])
    pushed = sum(float(np.linalg.norm(push.force)) * float(far.max()) for push in compiled.scene.pushes)
    return float((mass * far).sum() * np.linalg.norm(compiled.scene.gravity)) + pushed


def _points(shape: Polygon | Mesh) -> Array:
    return shape.exterior if isinstance(shape, Polygon) else shape.vertices
