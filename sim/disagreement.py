"""Why physics and statics disagree on an assembly: found by experiment, never guessed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mocca_robot.assembly import Array, Assembly, IntArray
from mocca_robot.contacts import Contact
from mocca_robot.joints.joint import contact_rays
from mocca_robot.loads import LoadCase
from mocca_robot.statics import Status
from mocca_robot.verify import solve_rays
from sim.motion import Motion, displacement_and_speed, let_go_gently, reach
from sim.scene import Compiled, with_timestep
from sim.settings import SLIDING_STEPS
from sim.stability import LIMITS, StabilityReport, Verdict, contact_points, judged

NOT_MADE = "friction not made by the fall"
"""Begins the cause of a fall that statics prevents with forces which nothing brings about."""
SEEN = 0.01
"""Displacement, relative to the part, at which a fall shows which contacts open."""
OPEN = 0.005
"""A contact opens, or slides, by more than this share of the fastest relative motion at any contact: micrometres when a
fall is seen, where contacts that stay closed give by nanometres."""
PRESSED = 0.01
"""Share of the lighter part's weight with which two parts have to press on each other, on average over a fall, for
friction between them to come of it."""
EVERY = 5
"""Steps between two looks at forces."""


def cause(
    assembly: Assembly, contacts: Sequence[Contact], case: LoadCase, tilted: Compiled, found: StabilityReport
) -> str:
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
            tried += "; finer ones would take hours"
    if found.verdict is Verdict.FELL and settings.friction > 0.0:
        opened, rays = coulomb_rays(assembly, contacts, found.motion, settings.friction)
        told = f"{NOT_MADE}: {tried}; statics, too, lets it fall with the forces that go with this fall"
        if not _holds(assembly, contacts, case, rays):
            return f"{told} ({opened} of {len(rays)} contact points open)"
        pressed = pressed_pairs(with_timestep(tilted, settings.timestep / LIMITS.finer[0], SLIDING_STEPS))
        kept = [(pair, point, d if pair in pressed else d[:0]) for pair, point, d in rays]
        if not _holds(assembly, contacts, case, kept):
            pairs = {pair for pair, _, _ in rays}
            return f"{told} ({len(pairs - pressed)} of {len(pairs)} pairs of parts are not pressed together)"
    for gentle in (0.0, 0.4):
        other = judged(tilted, replace(LIMITS, gentle_s=gentle)).verdict
        if other not in (found.verdict, Verdict.FAILED):
            return f"history of friction forces: {other} when let go over {gentle:g} s"
    return f"none found ({tried}; another way of letting go changes nothing)"


def coulomb_rays(
    assembly: Assembly, contacts: Sequence[Contact], motion: Motion, friction: float
) -> tuple[int, list[tuple[tuple[int, int], Array, Array]]]:
    """Return how many contact points a fall opens, and the forces that go with it.

    The forces are one entry per contact point: pair of parts, point (d,), directions (k, d) whose cone the force lies
    in: none where the fall opens it, the friction cone where it sticks, and what lies between the normal and full
    friction against the sliding where it slides: what falls with less than full friction falls all the more.
    """
    pairs, points, normals = contact_rays(contacts)
    relative = _relative_motion(assembly, pairs, points, motion)
    fastest = np.linalg.norm(relative, axis=1).max()
    out, opened = [], 0
    for pair, point, normal, move in zip(pairs, points, normals, relative):
        gap = float(move @ normal)
        slide = move - gap * normal
        speed = float(np.linalg.norm(slide))
        if gap > OPEN * fastest:
            directions = np.zeros((0, len(normal)))
            opened += 1
        elif speed > OPEN * fastest:
            directions = np.stack([normal, normal - friction * slide / speed])
        else:
            directions = normal + friction * _around(normal)
        out.append(((int(pair[0]), int(pair[1])), point, directions))
    return opened, out


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
        across = np.array([-normal[1], normal[0]])
        return np.array([across, -across])
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    first /= np.linalg.norm(first)
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.outer(np.cos(angles), first) + np.outer(np.sin(angles), np.cross(normal, first))


def _relative_motion(assembly: Assembly, pairs: IntArray, points: Array, motion: Motion) -> Array:
    """Return how far each contact point of the later part has gone from that of the earlier one, once clearly."""
    sample = _seen(assembly, motion)
    moved = {int(p): _displaced(assembly, int(p), motion.poses[sample][k]) for k, p in enumerate(motion.parts)}
    still = (np.eye(assembly.dimension), np.zeros(assembly.dimension))
    travel = np.zeros((2, *points.shape))
    for side in (0, 1):
        for part in np.unique(pairs[:, side]):
            mine = pairs[:, side] == part
            turn, shift = moved.get(int(part), still)
            centre = assembly.parts[part].centroid
            travel[side, mine] = (points[mine] - centre) @ turn.T + centre + shift - points[mine]
    return np.asarray(travel[1] - travel[0])


def _displaced(assembly: Assembly, part: int, pose: Array) -> tuple[Array, Array]:
    """Return rotation and shift of a part from its place; flat poses are x, y, turn."""
    import mujoco

    if len(pose) == 3:
        c, s = np.cos(pose[2]), np.sin(pose[2])
        return np.array([[c, -s], [s, c]]), pose[:2]
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, np.ascontiguousarray(pose[3:]))
    return turn.reshape(3, 3), pose[:3] - assembly.parts[part].centroid


def _holds(
    assembly: Assembly,
    contacts: Sequence[Contact],
    case: LoadCase,
    rays: Sequence[tuple[tuple[int, int], Array, Array]],
) -> bool:
    directions = np.concatenate([d for _, _, d in rays])
    pairs = np.array([pair for pair, _, d in rays for _ in d])
    points = np.array([point for _, point, d in rays for _ in d])
    normals = directions / np.linalg.norm(directions, axis=1)[:, None]
    return solve_rays(assembly, contacts, case, (pairs, points, normals)).status is Status.EQUILIBRIUM
