"""An assembly in the browser: sequence, exploded view, insertion cones, contact forces, collapse motion."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly
from mocca_robot.errors import EnvironmentNeeded
from mocca_robot.files.output import write_atomic
from mocca_robot.geometry.extrusion import surface
from mocca_robot.joints.joint import contact_rays
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.motion.ways_out import insertion_rim
from mocca_robot.statics.cases import case_at, solve_case
from mocca_robot.tolerances import EXACT, VISIBLE
from mocca_robot.verdicts.physics import Verdict
from sim.insertion.directions import insertion_cone
from sim.motion import Motion, run
from sim.scene import Compiled, compile_scene, with_timestep
from sim.shapes.contact_model import contact_model, embed
from sim.show.mjcf import colour
from sim.stability import free_scene, judged

INSTALL = "The viewer needs viser: `pip install mocca-robot[viewer]`. report.html shows the same without it."
FRAMES_PER_PART = 15
FRAME_S = 0.04
SEEN_FALL = 0.4
"""Displacement, in assembly sizes, at which a fall has been seen."""
LONGEST_FALL_S = 1.5


@dataclass(frozen=True, eq=False)
class Shown:
    """What the viewer shows.

    Attributes:
        assembly: parts in sequence.
        ways: (N, 3) unit vectors along which parts go in; zero for fixed ones.
        cones: (m, 2, 3) segments along the insertion cones' rims.
        forces: (k, 2, 3) arrows of the contact forces by statics, from tail to head; the largest is half as long
            as the assembly.
        motion: what physics does when the finished assembly is let go.
    """

    assembly: Assembly
    ways: Array
    cones: Array
    forces: Array
    motion: Motion


def shown(graph: PartsGraph) -> Shown:
    """Return what there is to see of an assembly."""
    assembly, contacts = graph.assembly, graph.contacts
    ways = np.zeros((len(assembly.parts), 3))
    cones: list[Array] = []
    for index, part in enumerate(assembly.parts):
        if part.fixed:
            continue
        cone = insertion_cone(graph, index)
        ways[index] = embed(np.asarray(cone.axis))
        tip, length = embed(part.centroid), 0.15 * assembly.size
        rim = embed(np.asarray(insertion_rim(-np.asarray(cone.axis), cone.tried_rad)))
        cones += [np.stack([tip, tip + length * way]) for way in rim]
    _, points, normals = contact_rays(contacts)
    forces = solve_case(graph, case_at(assembly, 0.0, 0.0)).result.forces.reshape(len(points), -1)[:, 0]
    scale = 0.5 * assembly.size / max(float(forces.max(initial=0.0)), EXACT)
    tails = embed(points)
    arrows = np.stack([tails, tails + scale * forces[:, None] * embed(normals)], axis=1)
    motion = _let_go(compile_scene(free_scene(assembly, contact_model(assembly, contacts))))
    strong = forces > VISIBLE * max(float(forces.max(initial=0.0)), EXACT)
    return Shown(assembly, ways, np.array(cones).reshape(-1, 2, 3), arrows[strong], motion)


def _let_go(compiled: Compiled) -> Motion:
    """Return the motion of the verdict; of a fall, more than the verdict needs: until it is plain to see."""
    found = judged(compiled)
    if found.verdict is not Verdict.FELL:
        return found.motion
    size = compiled.scene.assembly.size

    def plain(time: float, displacement: Array, speed: Array) -> bool:
        return bool(displacement.max() > SEEN_FALL * size)

    return run(with_timestep(compiled, found.timestep), LONGEST_FALL_S, plain, samples=round(LONGEST_FALL_S / 0.01))


def poses(what: Shown, placed: float, spread: float, time: float) -> list[tuple[Array, Array, bool]]:
    """Return (position, quaternion, visible) of every part.

    Args:
        placed: how many free parts have been placed; a fraction shows the next one on its way in.
        spread: of the exploded view, in assembly sizes.
        time: of the collapse motion, seconds.
    """
    out, number = [], 0
    moving = {int(p): k for k, p in enumerate(what.motion.parts)}
    sample = int(np.abs(what.motion.times - time).argmin())
    for index, part in enumerate(what.assembly.parts):
        position, turn, visible = embed(part.centroid), np.array([1.0, 0.0, 0.0, 0.0]), True
        if not part.fixed:
            if time > 0.0 and index in moving:
                position, turn = _moved(position, what.motion.poses[sample][moving[index]])
            away = min(1.0, max(0.0, number + 1 - placed))
            visible = number < placed
            position = position - what.ways[index] * what.assembly.size * (0.5 * away + spread * (number + 1) / 4)
            number += 1
        out.append((position, turn, visible))
    return out


def _moved(place: Array, pose: Array) -> tuple[Array, Array]:
    """Return position and quaternion in the world; flat poses are offsets and a turn about −y."""
    if len(pose) == 7:
        return pose[:3], pose[3:]
    half = 0.5 * float(pose[2])
    return place + np.array([pose[0], 0.0, pose[1]]), np.array([np.cos(half), 0.0, -np.sin(half), 0.0])


def open_viewer(what: Shown, port: int = 8080) -> Any:
    """Return a running server on this machine only, with its sliders. Raises EnvironmentNeeded without viser."""
    server, handles, extras = _scene(what, port)
    free = sum(not p.fixed for p in what.assembly.parts)
    sequence = server.gui.add_slider("sequence", 0.0, float(free), 0.05, float(free))
    spread = server.gui.add_slider("exploded view", 0.0, 1.0, 0.01, 0.0)
    end = max(round(float(what.motion.times[-1]), 2), 0.01)
    time = server.gui.add_slider("let go: time (s)", 0.0, end, 0.01, 0.0)
    boxes = {name: server.gui.add_checkbox(name, True) for name in extras}

    def update(_event: Any = None) -> None:
        _apply(handles, poses(what, sequence.value, spread.value, time.value))
        for name, box in boxes.items():
            extras[name].visible = box.value

    for control in (sequence, spread, time, *boxes.values()):
        control.on_update(update)
    return server


def export_page(what: Shown, path: str | Path) -> Path:
    """Return `path` after writing a self-contained page that plays the sequence, the exploded view and the motion.

    Raises EnvironmentNeeded without viser.
    """
    server, handles, _extras = _scene(what, 0)
    try:
        serializer = server.get_scene_serializer()
        free = sum(not p.fixed for p in what.assembly.parts)
        frames = [(float(k), 0.0, 0.0) for k in np.linspace(0.0, free, FRAMES_PER_PART * free + 1)]
        frames += [(float(free), float(s), 0.0) for s in np.sin(np.linspace(0.0, np.pi, 3 * FRAMES_PER_PART)) * 0.5]
        frames += [(float(free), 0.0, float(t)) for t in np.arange(0.0, what.motion.times[-1], FRAME_S / 2)]
        for frame in frames:
            _apply(handles, poses(what, *frame))
            serializer.insert_sleep(FRAME_S)
        return write_atomic(Path(path), serializer.as_html().encode())
    finally:
        with redirect_stdout(StringIO()):
            server.stop()


def _apply(handles: Sequence[Any], where: Sequence[tuple[Array, Array, bool]]) -> None:
    for handle, (position, turn, visible) in zip(handles, where, strict=True):
        handle.position, handle.wxyz, handle.visible = position, turn, visible


def _scene(what: Shown, port: int) -> tuple[Any, list[Any], dict[str, Any]]:
    try:
        import viser
    except ImportError:
        raise EnvironmentNeeded(INSTALL) from None
    # Only this machine may look: a viewer is no public server.
    with redirect_stdout(StringIO()):  # what it prints would mix with --json
        server = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
    size = what.assembly.size
    bounds = np.array([embed(p.centroid) for p in what.assembly.parts])
    middle = 0.5 * (bounds.min(axis=0) + bounds.max(axis=0))
    server.scene.set_up_direction("+z")
    server.initial_camera.look_at = middle
    server.initial_camera.position = middle + size * np.array([0.25, -1.2, 0.3])
    handles = []
    for index, part in enumerate(what.assembly.parts):
        mesh = surface(part)
        rgb = tuple(round(255 * float(c)) for c in colour(what.assembly, index)[:3])
        vertices = mesh.vertices - embed(part.centroid)
        name = f"/parts/{index}"
        handles.append(server.scene.add_mesh_simple(name, vertices, mesh.faces, color=rgb, flat_shading=True))
    extras: dict[str, Any] = {}
    if len(what.cones):
        lines = server.scene.add_line_segments("/cones", what.cones, (40, 120, 40), thickness=0.002 * size)
        extras["insertion cones"] = lines
    if len(what.forces):
        radii = {"shaft_radius": 0.003 * size, "head_radius": 0.008 * size, "head_length": 0.02 * size}
        extras["contact forces"] = server.scene.add_arrows("/forces", what.forces, (200, 40, 40), **radii)
    _apply(handles, poses(what, float(len(what.assembly.parts)), 0.0, 0.0))
    return server, handles, extras
