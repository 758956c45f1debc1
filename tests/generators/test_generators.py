"""Generators: closed blocks with shared walls, closed-form volumes and verdicts, refusals that say where."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

from mocca_robot.assembly import Assembly
from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.generators import generate
from mocca_robot.geometry.cones import largest_cone
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import case_at, critical_tilt, solve_case


def require_closed(assembly: Assembly) -> None:
    for part in assembly.parts:
        mesh = trimesh.Trimesh(part.shape.vertices, part.shape.faces, process=False)
        assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0, part.name
    assert not find_contacts(assembly).overlaps


def stands(assembly: Assembly, friction: float) -> bool:
    graph = PartsGraph.of(assembly)
    return solve_case(graph, case_at(assembly, 0.0, 0.0), friction).result.stands


@pytest.mark.parametrize(("shift", "expected"), [(0.05, True), (0.20, False)])
def test_a_leaning_stack_falls_beyond_its_closed_form_limit(shift, expected):
    # n blocks shifted by s of their length stand while s (n − 1) / 2 < 1/2 above the lowest: 0.125 for 9 on 1.
    stack = generate("stack", {"count": 10, "shift": shift})
    require_closed(stack)
    assert len(find_contacts(stack).contacts) == 9
    assert stands(stack, 0.0) is expected


def test_a_tilted_stack_slides_at_the_angle_of_friction():
    for tilt, expected in ((16.0, True), (17.5, False)):
        assert stands(generate("stack", {"count": 3, "tilt_deg": tilt}), 0.3) is expected


@pytest.mark.parametrize(("ratio", "expected"), [(0.12, True), (0.09, False)])
def test_a_semicircular_arch_needs_its_thickness(ratio, expected):
    # 27 free voussoirs over a half circle between two fixed ones; the limit is about 0.1075.
    arch = generate("arch", {"voussoirs": 29, "radius": 1.0, "thickness": ratio, "span_deg": 180 * 29 / 27})
    require_closed(arch)
    assert len(find_contacts(arch).contacts) == 28
    assert stands(arch, 0.55) is expected


def test_an_arch_has_the_volume_of_its_polygons():
    n, r, t, w = 12, 2.0, 0.3, 0.5
    arch = generate("arch", {"voussoirs": n, "radius": r, "thickness": t, "width": w, "span_deg": 120})
    wedge = 0.5 * np.sin(np.deg2rad(120) / n) * ((r + t / 2) ** 2 - (r - t / 2) ** 2) * w
    assert sum(p.shape.volume for p in arch.parts) == pytest.approx(n * wedge)
    assert arch.sequence[-1] in ("voussoir_06", "voussoir_07")


def test_a_wall_has_running_bond():
    wall = generate("wall", {"courses": 4, "columns": 3, "size": [0.2, 0.1, 0.1]})
    require_closed(wall)
    assert len(wall.parts) == 3 + 4 + 3 + 4
    # Beds: every change between courses overlaps 2 × columns half bricks; heads: 2 or 3 per course.
    assert len(find_contacts(wall).contacts) == 3 * 6 + 2 * (2 + 3)
    assert sum(p.shape.volume for p in wall.parts) == pytest.approx(0.6 * 0.1 * 0.4)
    assert critical_tilt(PartsGraph.of(wall), 0.0) == pytest.approx(0.0, abs=1e-6)


def test_a_dome_is_closed_and_its_keys_go_in_from_above():
    given = {"blocks": [16, 16, 14, 12, 9, 6], "top_deg": 18}
    dome = generate("dome", given)
    require_closed(dome)
    assert len(dome.parts) == sum(given["blocks"]) + 1
    assert [p.fixed for p in dome.parts].count(True) == 16
    cones = insertion_cones(dome)
    assert min(cones.values()) > np.deg2rad(9)
    upright = insertion_cones(generate("dome", {**given, "key_lean_deg": 0.0}))
    for key in ("ring02_16", "ring03_14", "ring04_12", "ring05_09"):
        assert cones[key] > upright[key] + np.deg2rad(4), key


def insertion_cones(assembly: Assembly) -> dict[str, float]:
    """The widest insertion cone of every free part, radians."""
    contacts = find_contacts(assembly).contacts
    cones = {}
    for index, part in enumerate(assembly.parts):
        if not part.fixed:
            cones[part.name] = largest_cone(np.array([c.normal for c in contacts if c.parts[1] == index]))[0]
    return cones


def test_a_door_leaves_out_blocks():
    whole = find_contacts(generate("dome", {"blocks": [12, 12, 10]})).contacts
    doorway = generate("dome", {"blocks": [12, 12, 10], "door_deg": 40, "door_rings": 2})
    require_closed(doorway)
    assert len(find_contacts(doorway).contacts) < len(whole)
    front = [p for p in doorway.parts if p.centroid[1] < -0.9 and abs(p.centroid[0]) < 0.15 and p.centroid[2] < 0.5]
    assert not front


def quads(path, radius, height, around: int, up: int, *, closed: bool = True) -> None:
    """A surface of quadrangles: radius(phi, t), height(t) with t from 0 to 1."""
    lines = []
    columns = around if closed else around + 1
    for k in range(up + 1):
        for c in range(columns):
            phi, t = 2 * np.pi * c / around, k / up
            r = radius(phi, t)
            lines.append(f"v {r * np.cos(phi)!r} {r * np.sin(phi)!r} {height(t)!r}")
    for k in range(up):
        for c in range(around):
            a, b = k * columns + c, k * columns + (c + 1) % columns
            lines.append(f"f {a + 1} {b + 1} {b + columns + 1} {a + columns + 1}")
    path.write_text("\n".join(lines).replace("np.float64(", "").replace(")", "") + "\n")


def test_points_without_polygons_change_nothing_about_a_shell(tmp_path):
    """The lower half of a ball was cut off, its points were left: the ground is where the surface ends."""
    ball = trimesh.creation.icosphere(1)
    upper = [face for face in ball.faces if (ball.vertices[face, 2] > -0.1).all()]
    lines = ["v {:.12g} {:.12g} {:.12g}".format(*v) for v in ball.vertices]
    lines += ["f " + " ".join(str(v + 1) for v in face) for face in upper]
    (tmp_path / "half.obj").write_text("\n".join(lines) + "\n")
    shell = generate("shell", {"surface": "half.obj", "thickness": 0.15, "ground": 0.05}, tmp_path)
    require_closed(shell)
    assert len(shell.parts) == len(upper)
    assert 0 < shell.fixed.sum() < len(upper)


def test_a_shell_of_revolution_has_flat_walls(tmp_path):
    quads(tmp_path / "vase.obj", lambda phi, t: 1.0 - 0.3 * t + 0.1 * np.sin(6 * t), lambda t: 1.5 * t, 9, 4)
    shell = generate("shell", {"surface": "vase.obj", "thickness": 0.1}, tmp_path)
    require_closed(shell)
    assert len(shell.parts) == 36
    assert [p.fixed for p in shell.parts].count(True) == 9
    contacts = find_contacts(shell).contacts
    assert len(contacts) == 9 * 4 + 9 * 3
    assert all(len(c.polygon) == 4 for c in contacts)


@pytest.mark.parametrize("lobe", [0.0, 0.08])
def test_running_bond_makes_the_walls_of_a_free_form_flat(tmp_path, lobe):
    quads(tmp_path / "s.obj", lambda phi, t: (1 - 0.2 * t) * (1 + lobe * t * np.cos(2 * phi)), lambda t: 1.2 * t, 12, 4)
    shell = generate("shell", {"surface": "s.obj", "thickness": 0.08, "bond": "running"}, tmp_path)
    require_closed(shell)
    assert len(shell.parts) == 48
    # Per row 12 heads; between rows each block meets two.
    assert len(find_contacts(shell).contacts) == 4 * 12 + 3 * 24


def test_a_surface_without_flat_walls_is_refused_with_the_place(tmp_path):
    # A dented ring of triangles: more walls than corners can bend, and no direction that suits all sides.
    rng = np.random.default_rng(1)
    lines, n, m = [], 12, 8
    for a in 2 * np.pi * np.arange(n) / n:
        for b in 2 * np.pi * np.arange(m) / m:
            r = 0.3 + rng.uniform(-0.03, 0.03)
            x, y, z = (1 + r * np.cos(b)) * np.cos(a), (1 + r * np.cos(b)) * np.sin(a), r * np.sin(b)
            lines.append(f"v {x} {y} {z}")
    for a in range(n):
        for b in range(m):
            p, q, u, v = (1 + (a + i) % n * m + (b + j) % m for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
            lines += [f"f {p} {q} {u}", f"f {p} {u} {v}"]
    (tmp_path / "crumpled.obj").write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=r"cannot be cut into blocks.*the wall near \(.*m away from flat"):
        generate("shell", {"surface": "crumpled.obj", "thickness": 0.1}, tmp_path)


def test_rods_share_the_planes_between_them(tmp_path):
    lines = {"nodes": [[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0], [0, 1, 1]], "rods": [[0, 1], [3, 2], [1, 2], [1, 4]]}
    (tmp_path / "frame.json").write_text(json.dumps(lines))
    frame = generate("frame", {"lines": "frame.json", "width": 0.1, "height": 0.1}, tmp_path)
    require_closed(frame)
    assert [p.fixed for p in frame.parts] == [True, True, False, False]
    contacts = {c.parts: c for c in find_contacts(frame).contacts}
    assert set(contacts) == {(0, 2), (0, 3), (1, 2), (2, 3)}
    # A mitre: the diagonal cut of the section.
    assert contacts[1, 2].measure == pytest.approx(0.1 * 0.1 * np.sqrt(2))
    (tmp_path / "frame.obj").write_text("v 0 0 0\nv 0 0 1\nv 1 0 1\nl 1 2 3\n")
    bent = generate("frame", {"lines": "frame.obj", "width": 0.1, "height": 0.1}, tmp_path)
    assert len(find_contacts(bent).contacts) == 1


def test_posts_turn_a_face_to_the_beams_they_carry_wherever_the_frame_lies(tmp_path):
    square = np.array([[0, 0, 0], [3, 0, 0], [3, 3, 0], [0, 3, 0]])
    rods = [[k, k + 4] for k in range(4)] + [[4 + k, 4 + (k + 1) % 4] for k in range(4)]
    for shift, turn in ((0.0, 0.0), (7.0, np.deg2rad(20.0))):
        spin = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        nodes = np.vstack([square, square + np.array([0, 0, 2.5])]) @ spin.T + [shift, -shift, 0]
        (tmp_path / "frame.json").write_text(json.dumps({"nodes": nodes.tolist(), "rods": rods}))
        frame = generate("frame", {"lines": "frame.json", "width": 0.2, "height": 0.3}, tmp_path)
        for post in frame.parts[:4]:
            extent = np.ptp(post.shape.vertices @ spin, axis=0)
            assert sorted(extent[:2]) == pytest.approx([0.2, 0.3]), post.name


@pytest.mark.parametrize(
    ("kind", "given", "message"),
    [
        ("doom", {}, "did you mean 'dome'"),
        ("dome", {"radios": 1.0}, "no parameter 'radios'; did you mean 'radius'"),
        ("dome", {"radius": -1.0}, r"dome\.radius is -1\.0"),
        ("dome", {"blocks": [12, 1]}, r"dome\.blocks\[1\] is 1"),
        ("dome", {"base_deg": 30, "top_deg": 40}, "less than base_deg"),
        ("shell", {"thickness": 0.1}, "needs 'surface'"),
        ("shell", {"surface": "none.obj", "thickness": 0.1}, "does not exist"),
        ("frame", {"lines": "none.json", "width": 0.1, "height": 0.1}, "does not exist"),
        ("stack", {"size": [0.1, 0.1]}, "list of 3 numbers"),
        ("stack", {"size": [0.1, 0.1, 0.0]}, "greater than zero"),
        ("arch", {"radius": 0.1, "thickness": 0.3}, "less than twice the radius"),
        ("wall", {"courses": "many"}, "whole number"),
    ],
)
def test_refusals_teach(tmp_path, kind, given, message):
    with pytest.raises(InputError, match=message):
        generate(kind, given, tmp_path)


def test_same_parameters_same_assembly():
    first, second = (generate("dome", {"blocks": [9, 8, 5], "snap": 0.2}) for _ in range(2))
    for a, b in zip(first.parts, second.parts):
        assert a.name == b.name
        assert (a.shape.vertices == b.shape.vertices).all()
        assert (a.shape.faces == b.shape.faces).all()
