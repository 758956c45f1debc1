"""Mesh files: exact round trips, repairs that are said, refusals that name part and number."""

from __future__ import annotations

import re

import numpy as np
import pytest
from solids import box

from mocca_robot.assembly import Mesh
from mocca_robot.config.model import read_model
from mocca_robot.errors import InputError
from mocca_robot.files.mending import repaired
from mocca_robot.files.mesh_write import write_glb, write_part, write_parts
from mocca_robot.files.meshes import read_mesh, read_parts
from mocca_robot.generators import generate

CUBE = box((0, 0, 0), (0.1, 0.2, 0.3))


def write_obj(path, *objects, normals=False):
    lines, first = [], 1
    for name, vertices, faces in objects:
        lines.append(f"o {name}")
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices).tolist()]
        lines += ["f " + " ".join(str(v + first) for v in face) for face in faces]
        first += len(vertices)
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply", "3mf", "glb"])
def test_parts_come_back_from_every_format(tmp_path, suffix):
    dome = generate("dome", {"blocks": [7, 6, 4]})
    meshes = [p.shape for p in dome.parts]
    write_parts(dome.sequence, meshes, tmp_path, suffix, "mm")
    back = {p.name: p.mesh for p in read_parts(tmp_path, None if suffix in ("3mf", "glb") else "mm")}
    assert back.keys() == set(dome.sequence)
    for part in dome.parts:
        assert back[part.name].volume == pytest.approx(part.shape.volume, rel=1e-5)
        assert back[part.name].bounds == pytest.approx(part.shape.bounds, abs=1e-6)


def test_obj_keeps_every_bit(tmp_path):
    mesh = Mesh(CUBE.vertices * np.pi, CUBE.faces)
    back = read_mesh(write_part(mesh, tmp_path / "cube.obj"), "m").mesh
    assert {tuple(v) for v in back.vertices} == {tuple(v) for v in mesh.vertices}


def test_one_file_with_one_object_per_part(tmp_path):
    path = write_obj(tmp_path / "two.obj", ("low", CUBE.vertices, CUBE.faces), ("high", CUBE.vertices + 1, CUBE.faces))
    low, high = read_parts(path, "m")
    assert (low.name, high.name) == ("low", "high")
    assert high.mesh.bounds == pytest.approx(CUBE.bounds + 1)
    assert len(low.mesh.vertices) == 8


def test_a_whole_assembly_as_glb(tmp_path):
    wall = generate("wall", {"courses": 2, "columns": 2})
    back = read_parts(write_glb(wall, tmp_path / "wall.glb"))
    assert [p.name for p in back] == list(wall.sequence)
    for part, read in zip(wall.parts, back):
        assert read.mesh.bounds == pytest.approx(part.shape.bounds, abs=1e-6)


def test_files_of_a_folder_come_in_natural_order(tmp_path):
    for k in (10, 2, 1):
        write_part(CUBE, tmp_path / f"{k}.obj")
    assert [p.name for p in read_parts(tmp_path, "m")] == ["1", "2", "10"]


def test_polygons_are_cut_into_triangles(tmp_path):
    base = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]], float) * 0.1
    points = np.concatenate([np.c_[base, np.zeros(6)], np.c_[base, np.full(6, 0.1)]])
    faces = [tuple(range(5, -1, -1)), tuple(range(6, 12))] + [
        (k, (k + 1) % 6, 6 + (k + 1) % 6, 6 + k) for k in range(6)
    ]
    mesh = read_mesh(write_obj(tmp_path / "ell.obj", ("ell", points, faces)), "m").mesh
    assert mesh.volume == pytest.approx(0.005)


def test_repairs_are_made_and_said():
    inside_out, notes = repaired("p", CUBE.vertices, CUBE.faces[:, ::-1])
    assert inside_out.volume == pytest.approx(CUBE.volume)
    assert "turned right side out" in notes[0]

    mixed = np.array(CUBE.faces)
    mixed[3] = mixed[3][::-1]
    mesh, notes = repaired("p", CUBE.vertices, mixed)
    assert mesh.volume == pytest.approx(CUBE.volume)
    assert any("neighbours agree" in n for n in notes)

    soup = CUBE.vertices[CUBE.faces].reshape(-1, 3)
    mesh, notes = repaired("p", soup, np.arange(len(soup)).reshape(-1, 3))
    assert len(mesh.vertices) == 8
    assert notes == ()

    mesh, notes = repaired("p", CUBE.vertices, np.concatenate([CUBE.faces, [[0, 0, 1]]]))
    assert len(mesh.faces) == 12
    assert "two equal corners" in notes[0]


def test_an_open_mesh_is_refused_with_the_number_of_open_edges_and_where():
    corner = np.flatnonzero((CUBE.faces == 0).any(axis=1))
    assert len(corner) >= 4, "a hole around a corner can be closed in many ways"
    rest = np.delete(CUBE.faces, corner, axis=0)
    with pytest.raises(InputError, match=r"'lid' is not closed: \d+ of its edges .* near \(.*guessing"):
        repaired("lid", CUBE.vertices, rest)


@pytest.mark.parametrize("missing", range(12))
def test_a_missing_triangle_is_put_back_and_said(missing):
    mesh, notes = repaired("lid", CUBE.vertices, np.delete(CUBE.faces, missing, axis=0))
    assert mesh.volume == pytest.approx(CUBE.volume, rel=1e-12)
    (said,) = notes
    assert re.fullmatch(r"a hole closed by 1 triangle: area 0\.(19|205|21) → 0\.22 m², volume 0\.006 m³", said)


def test_a_missing_face_of_a_box_is_closed_but_not_a_bent_hole():
    flat = CUBE.vertices[CUBE.faces]
    top = np.isclose(flat[:, :, 2], CUBE.bounds[1, 2]).all(axis=1)
    mesh, notes = repaired("box", CUBE.vertices, CUBE.faces[~top])
    assert mesh.volume == pytest.approx(CUBE.volume, rel=1e-12)
    assert notes == ("a hole closed by 2 triangles: area 0.2 → 0.22 m², volume 0.006 m³",)
    bent = np.array(CUBE.vertices)
    bent[np.flatnonzero(np.isclose(bent[:, 2], bent[:, 2].max()))[0], 2] *= 1.2
    with pytest.raises(InputError, match="is not closed: 4"):
        repaired("box", bent, CUBE.faces[~top])


def test_a_size_that_is_meant_is_said_to_be(tmp_path):
    write_part(Mesh(CUBE.vertices * 1e4, CUBE.faces), tmp_path / "big.obj")
    with pytest.raises(InputError, match="write 'scale: 1'"):
        read_model(tmp_path / "big.obj", "m", None)
    assert read_model(tmp_path / "big.obj", "m", 1.0).assembly.parts[0].shape.volume > 1e9


def test_a_flat_mesh_is_refused():
    flat = np.array(CUBE.vertices)
    flat[:, 2] = 0.0
    with pytest.raises(InputError, match="encloses no volume"):
        repaired("leaf", flat, CUBE.faces)


def test_units_are_asked_for_and_doubted(tmp_path):
    path = write_part(CUBE, tmp_path / "cube.obj")
    with pytest.raises(InputError, match="carry no unit; give 'units'"):
        read_parts(path)
    with pytest.raises(InputError, match="did you mean 'mm'"):
        read_parts(path, "mms")
    with pytest.raises(InputError, match=r"only 0\.374 mm across"):
        read_parts(path, "mm")
    write_part(Mesh(CUBE.vertices * 1e4, CUBE.faces), tmp_path / "big.obj")
    with pytest.raises(InputError, match="3,000 m across"):
        read_parts(tmp_path / "big.obj", "m")
    assert len(read_parts(tmp_path / "big.obj", "m", any_size=True)) == 1


def test_broken_files_are_named(tmp_path):
    (tmp_path / "bad.obj").write_text("v 0 0 zero\n")
    with pytest.raises(InputError, match=r"bad\.obj, line 1"):
        read_parts(tmp_path / "bad.obj", "m")
    (tmp_path / "face.obj").write_text("v 0 0 0\nf 1 2 3\n")
    with pytest.raises(InputError, match="vertex that does not exist"):
        read_parts(tmp_path / "face.obj", "m")
    (tmp_path / "noise.stl").write_bytes(b"no mesh at all")
    with pytest.raises(InputError, match=r"noise\.stl"):
        read_parts(tmp_path / "noise.stl", "m")
    with pytest.raises(InputError, match="does not exist"):
        read_parts(tmp_path / "absent.obj", "m")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no mesh"):
        read_parts(tmp_path / "empty", "m")
