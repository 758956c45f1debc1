"""Why physics and statics disagree on an assembly: found by experiment, never guessed."""

from __future__ import annotations

from collections.abc import Iterator, Set
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from mocca_robot.arrays import Array, BoolArray, IntArray
from mocca_robot.assembly import Assembly
from mocca_robot.geometry.frames import tangents
from mocca_robot.joints.joint import contact_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import solve_rays
from mocca_robot.statics.loads import LoadCase
from mocca_robot.statics.solution import Status, solve_system
from mocca_robot.statics.solver.system import ContactSystem
from mocca_robot.verdicts.physics import Verdict
from sim.motion import Motion, displacement_and_speed, let_go_gently, reach
from sim.scene import Compiled, with_timestep
from sim.settings import SLIDING_STEPS
from sim.stability import LIMITS, StabilityReport, at_once, contact_points, judged

NOT_MADE = "friction not made by the fall"
"""Begins the cause of a fall that statics prevents with forces which nothing brings about."""
SEEN = 0.01
"""Displacement, relative to the part, at which a fall shows which contacts open."""
MOVES = 0.005
"""Displacement, relative to the farthest, from which a part takes part in a fall: micrometres when the fall is seen,
where what stands gives by tenths of one."""
WEIGHTS, HOPS = 10.0, 2.0
"""A contact opens, or slides, where it does by more than it gives under so many weights of a part, and by more than so
many hops: MuJoCo's friction lifts what slides by μ times the way of a step."""
SHARPEST = 100.0
"""Divisor of the step for a fall whose opening contacts cannot be told from hops otherwise."""
ROUNDING = 1e-6
"""The least opening, relative to the fastest relative motion at any contact."""
BELIEVED = 1e-7
"""Residual up to which the rigid motion next to a fall tells which contacts it opens."""
PRESSED = 0.01
"""Share of the lighter part's weight with which two parts have to press on each other, on average over a fall, for
friction between them to come of it."""
EVERY = 5
"""Steps between two looks at forces."""


def cause(graph: PartsGraph, case: LoadCase, tilted: Compiled, found: StabilityReport) -> str:
    """Return what explains that physics found otherwise than statics.

    'soft contacts': a much finer step, with contacts stiffer by its square, gives another verdict.
    'friction': statics holds the parts only with forces that their fall does not bring about: in contacts that it
    opens, between parts that it does not press together, or with friction that does not oppose its sliding. Coulomb's
    law allows them at rest (parts that clamp each other), nothing makes them: statics bounds the tilt from above.
    'history': let go at once, or more gently, it ends otherwise; friction forces depend on how they build up.
    'none found' else.
    """
    settings = tilted.scene.settings
    finest, tried = found.timestep, f"{found.verdict} with a step of {found.timestep * 1e6:.3g} µs"
    if finest > 1.01 * settings.timestep / LIMITS.finest:
        if contact_points(tilted) <= LIMITS.finest_points:
            finest = settings.timestep / LIMITS.finest
            stiff = judged(with_timestep(tilted, finest), replace(LIMITS, finer=()))
            if stiff.verdict not in (found.verdict, Verdict.FAILED):
                return f"soft contacts: {stiff.verdict} with a step of {finest * 1e6:.3g} µs"
            if stiff.verdict is Verdict.FAILED:
                tried += f"; no verdict with {finest * 1e6:.3g} µs"
            else:
                found, tried = stiff, f"{stiff.verdict} with a step of {finest * 1e6:.3g} µs, too"
        else:
            tried += "; finer ones are left out with so many contact points"
    if found.verdict is Verdict.FELL and settings.friction > 0.0:
        told = f"{NOT_MADE}: {tried}; statics lets it fall as well with the forces that go with this fall"
        pressed: set[tuple[int, int]] | None = None
        for fall in _falls(graph, tilted, found):
            if not holds(graph, case, fall):
                return f"{told} ({fall.opened} of {fall.opened + len(fall.rays)} contact points open)"
            if pressed is None:
                pressed = pressed_pairs(with_timestep(tilted, settings.timestep / LIMITS.finer[0], SLIDING_STEPS))
            if not holds(graph, case, fall.only(pressed)):
                pairs = {pair for pair, _, _ in fall.rays}
                return f"{told} ({len(pairs - pressed)} of {len(pairs)} pairs of parts are not pressed together)"
    for gentle in (0.0, 0.4):
        other = judged(tilted, replace(LIMITS, gentle_s=gentle)).verdict
        if other not in (found.verdict, Verdict.FAILED):
            return f"history of friction forces: {other} when let go over {gentle:g} s"
    return f"none found ({tried}; another way of letting go changes nothing)"


@dataclass(frozen=True, eq=False)
class FallForces:
    """The forces that go with a fall.

    Attributes:
        moving: (N,) the parts that fall; others stand.
        opened: contact points of theirs that open.
        rays: one entry per contact point that stays closed: pair of parts, point (d,), directions (k, d) whose cone the
            force lies in. That is the friction cone where it sticks, and what lies between the normal and full friction
            against the sliding where it slides: what falls with less than full friction falls all the more.
    """

    moving: BoolArray
    opened: int
    rays: tuple[tuple[tuple[int, int], Array, Array], ...]

    def only(self, pairs: Set[tuple[int, int]]) -> FallForces:
        """Return the fall with forces between some pairs of parts only."""
        return replace(self, rays=tuple(r for r in self.rays if r[0] in pairs))


def _falls(graph: PartsGraph, tilted: Compiled, found: StabilityReport) -> Iterator[FallForces]:
    """Yield the forces that go with the fall `found`, then those of the same fall with the sharpest step."""
    settings, ends = tilted.scene.settings, replace(LIMITS, fallen=LIMITS.told * LIMITS.moved)
    for step in (found.timestep, settings.timestep / SHARPEST):
        if step != found.timestep:
            if contact_points(tilted) > LIMITS.finest_points:
                return
            found = at_once(with_timestep(tilted, step, SLIDING_STEPS), ends)
        speed = float(found.motion.speed[_seen(graph.assembly, found.motion)].max())
        give = replace(settings, timestep=step, contact_steps=SLIDING_STEPS).give
        fall = coulomb_rays(
            graph,
            found.motion,
            settings.friction,
            WEIGHTS * give + HOPS * settings.friction * speed * step,
        )
        if found.verdict is Verdict.FELL and fall is not None:
            yield fall


def coulomb_rays(graph: PartsGraph, motion: Motion, friction: float, least: float) -> FallForces | None:
    """Return the forces that go with a fall; None where its motion cannot be told well enough.

    Which contacts a fall opens is read from the rigid motion next to it, which Eq. 7 finds: parts do not enter each
    other, and what stays closed does so exactly. A contact opens, or slides, by more than `least` metres.
    """
    assembly = graph.assembly
    farthest = motion.displacement[_seen(assembly, motion)]
    moving = np.zeros(len(assembly.parts), dtype=np.bool_)
    moving[motion.parts[farthest > MOVES * farthest.max()]] = True
    pairs, points, normals = contact_rays(graph.contacts)
    theirs = moving[pairs].any(axis=1)
    pairs, points, normals = pairs[theirs], points[theirs], normals[theirs]
    about = np.array([p.centroid for p in assembly.parts])
    system = ContactSystem.build(pairs, points, normals, moving, about)
    result = solve_system(system, system.scaled_motion(_twists(assembly, motion)))
    if not result.kkt <= BELIEVED:
        return None
    i, j = pairs.T
    relative = _velocity(result.motions, about, j, points) - _velocity(result.motions, about, i, points)
    gaps = np.einsum("cd,cd->c", relative, normals)
    slides = relative - gaps[:, None] * normals
    speeds = np.linalg.norm(slides, axis=1)
    least = max(least, ROUNDING * float(np.linalg.norm(relative, axis=1).max(initial=0.0)))
    rays = []
    for c in np.flatnonzero(gaps <= least):
        if speeds[c] > least:
            directions = np.stack([normals[c], normals[c] - friction * slides[c] / speeds[c]])
        else:
            directions = normals[c] + friction * _around(normals[c])
        rays.append(((int(i[c]), int(j[c])), points[c], directions))
    return FallForces(moving, len(pairs) - len(rays), tuple(rays))


def pressed_pairs(compiled: Compiled) -> set[tuple[int, int]]:
    """Return which pairs of parts press on each other while a scene falls: by `PRESSED` of a weight on average.

    What slides hops, because MuJoCo's friction lifts it, so that single moments would not tell.
    """
    import mujoco

    scene, model, data = compiled.scene, compiled.model, mujoco.MjData(compiled.model)
    names = {p.name: k for k, p in enumerate(scene.assembly.parts)}
    part_of = np.array([names.get(model.body(b).name, -1) for b in range(model.nbody)])
    far = reach(scene.assembly)[compiled.parts]
    mujoco.mj_forward(model, data)
    start, force, samples = data.qpos.copy(), np.zeros((len(names) + 1, len(names) + 1)), 0
    let_go_gently(model, data, round(LIMITS.gentle_s / model.opt.timestep))
    for _ in range(round(LIMITS.first_look_s / model.opt.timestep) // EVERY):
        mujoco.mj_step(model, data, EVERY)
        first, second = np.sort(part_of[model.geom_bodyid[data.contact.geom]], axis=1).T
        carries = data.contact.efc_address >= 0
        np.add.at(force, (first[carries], second[carries]), data.efc_force[data.contact.efc_address[carries]])
        samples += 1
        if (displacement_and_speed(compiled, data, start, far)[0] > SEEN * 2.0 * far).any():
            break
    weight = np.array([p.mass for p in scene.assembly.parts]) * float(np.linalg.norm(scene.gravity))
    lighter = np.minimum.outer(weight, weight)
    return {(int(i), int(j)) for i, j in np.argwhere(force[:-1, :-1] >= PRESSED * samples * lighter)}


def _seen(assembly: Assembly, motion: Motion) -> int:
    """Return the first sample in which a part has clearly moved; the last one if none has."""
    size = np.array([np.ptp(p.shape.bounds, axis=0).max() for p in assembly.parts])[motion.parts]
    seen = (motion.displacement > SEEN * size).any(axis=1)
    return int(np.argmax(seen)) if seen.any() else len(motion.times) - 1


def _around(normal: Array, count: int = 16) -> Array:
    """Return unit vectors across `normal`: two in the plane, `count` in space."""
    if len(normal) == 2:
        return np.concatenate([tangents(normal), -tangents(normal)])
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) @ tangents(normal)


def _twists(assembly: Assembly, motion: Motion) -> Array:
    """Return (N, dof) shift of the centroid and turn (radians) of every part when the fall is clearly seen."""
    sample, d = _seen(assembly, motion), assembly.dimension
    out = np.zeros((len(assembly.parts), 3 if d == 2 else 6))
    for k, part in enumerate(motion.parts):
        pose = motion.poses[sample][k]
        if d == 2:
            out[part] = pose
        else:
            turn = Rotation.from_quat(np.roll(pose[3:], -1))  # MuJoCo has w first
            out[part] = [*(pose[:3] - assembly.parts[part].centroid), *turn.as_rotvec()]
    return out


def _velocity(motions: Array, about: Array, parts: IntArray, points: Array) -> Array:
    """Return (C, d) the velocity of points (C, d) as points of `parts` (C,), whose motions are (N, dof)."""
    d, lever = points.shape[1], points - about[parts]
    turn = motions[parts, d:]
    if d == 2:
        return np.asarray(motions[parts, :2] + turn * np.stack([-lever[:, 1], lever[:, 0]], axis=1))
    return np.asarray(motions[parts, :3] + np.cross(turn, lever))


def holds(graph: PartsGraph, case: LoadCase, fall: FallForces) -> bool:
    """Return whether its forces hold the parts that fall, while the others stand."""
    directions = [d / np.linalg.norm(d, axis=1)[:, None] for _, _, d in fall.rays]
    pairs = np.array([pair for pair, _, d in fall.rays for _ in d], dtype=np.int64).reshape(-1, 2)
    points = np.array([point for _, point, d in fall.rays for _ in d]).reshape(-1, graph.assembly.dimension)
    normals = np.concatenate([np.zeros((0, graph.assembly.dimension)), *directions])
    there = replace(case, held=case.held | ~fall.moving)
    return solve_rays(graph, there, (pairs, points, normals)).status is Status.EQUILIBRIUM
