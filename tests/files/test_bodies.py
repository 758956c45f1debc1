"""What is one part: bodies under one name, over several groups, in files without names, in other encodings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from solids import box

from mocca_robot.assembly import Mesh
from mocca_robot.config.config import load
from mocca_robot.errors import InputError
from mocca_robot.files.bodies import MeshObject, parts_of
from mocca_robot.files.mesh_write import write_part
from mocca_robot.files.meshes import read_parts

SEEDS = range(20)
LOW, MIDDLE, TOP = box((0, 0, 0), (2, 2, 1)), box((0, 0, 1), (1, 1, 2)), box((1.5, 0, 1), (2.5, 1, 2))


def obj(objects: list[tuple[str, Mesh]], scale: float = 1.0) -> str:
    lines, first = [], 1
    for head, mesh in objects:
        lines += [head] if head else []
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in (np.asarray(mesh.vertices) * scale).tolist()]
        lines += ["f " + " ".join(str(v + first) for v in face) for face in np.asarray(mesh.faces).tolist()]
        first += len(mesh.vertices)
    return "\n".join(lines) + "\n"


def ascii_stl(objects: list[tuple[str, Mesh]], scale: float = 1.0) -> str:
    out = []
    for name, mesh in objects:
        out.append(f"solid {name}")
        for triangle in (np.asarray(mesh.vertices) * scale)[np.asarray(mesh.faces)].tolist():
            out += [" facet normal 0 0 0", "  outer loop", *(f"   vertex {x!r} {y!r} {z!r}" for x, y, z in triangle)]
            out += ["  endloop", " endfacet"]
        out.append(f"endsolid {name}")
    return "\n".join(out) + "\n"


@pytest.mark.parametrize("seed", SEEDS)
def test_bodies_under_one_name_are_parts_unless_the_user_says_otherwise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scale = 10 ** rng.uniform(-3, 3)
    bodies = [Mesh(b.vertices * scale, b.faces) for b in (LOW, MIDDLE, TOP)]
    if seed % 2:
        things = [MeshObject("a", b.vertices, np.asarray(b.faces)) for b in bodies]
    else:
        faces = np.concatenate([b.faces + 8 * k for k, b in enumerate(bodies)])
        whole = np.concatenate([b.vertices for b in bodies])
        things = [MeshObject("a", whole, faces[rng.permutation(len(faces))])]
    parts = parts_of(things)
    assert [p.name for p in parts] == ["a_1", "a_2", "a_3"]
    assert {p.object for p in parts} == {"a"}
    assert sorted(p.mesh.volume / scale**3 for p in parts) == pytest.approx([1, 1, 4])
    assert "'a' holds 3 separate bodies" in parts[0].notes[0]
    assert "rigid: [a]" in parts[0].notes[0]
    (one,) = parts_of(things, ["a"])
    assert one.name == "a"
    assert one.mesh.volume / scale**3 == pytest.approx(6)
    assert "kept as one" in one.notes[0]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_body_whose_faces_lie_in_several_objects_is_one_part(seed: int) -> None:
    rng = np.random.default_rng(seed)
    owner = np.concatenate([[0, 1, 2], rng.integers(0, 3, 9)])
    names = ["block_top", "block side", "block-sole"] if seed % 2 else ["Dach", "Wand", "Boden"]
    things = []
    for k, name in enumerate(names):
        mine = MIDDLE.faces[owner == k]
        used, faces = np.unique(mine, return_inverse=True)
        jitter = rng.uniform(-1, 1, (len(used), 3)) * 1e-8
        things.append(MeshObject(name, MIDDLE.vertices[used] + jitter, faces.reshape(-1, 3)))
    things.insert(int(rng.integers(4)), MeshObject("ground", LOW.vertices, np.asarray(LOW.faces)))
    parts = {p.name: p for p in parts_of(things)}
    assert set(parts) == {"ground", "block" if seed % 2 else "Dach"}
    block = parts["block" if seed % 2 else "Dach"]
    assert block.mesh.volume == pytest.approx(1.0, rel=1e-6)
    assert any("close together" in n for n in block.notes)


def test_an_open_surface_beside_closed_ones_is_named() -> None:
    lid = MeshObject("lid", MIDDLE.vertices, np.asarray(MIDDLE.faces)[:7])
    with pytest.raises(InputError, match=r"'lid' is not closed: .* Rhino"):
        parts_of([MeshObject("ground", LOW.vertices, np.asarray(LOW.faces)), lid])
    with pytest.raises(InputError, match="'lid' is not closed"):
        parts_of([lid, MeshObject("rim", TOP.vertices, np.asarray(TOP.faces)[:7])])


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("name", ["stone", "Fußstein", "bloc né", "a # 1", "Größe 2/3"])
@pytest.mark.parametrize("suffix", ["obj", "stl"])
def test_names_are_kept_in_whatever_encoding(tmp_path: Path, suffix: str, name: str, encoding: str) -> None:
    things = [("ground", LOW), (name, MIDDLE)]
    text = obj([(f"o {n}", m) for n, m in things]) if suffix == "obj" else ascii_stl(things)
    (tmp_path / f"a.{suffix}").write_bytes(text.replace("\n", "\r\n").encode(encoding))
    parts = read_parts(tmp_path / f"a.{suffix}", "m")
    assert [p.name for p in parts] == ["ground", name]
    assert [p.mesh.volume for p in parts] == pytest.approx([4, 1])
    assert any("not UTF-8" in n for p in parts for n in p.notes) == (encoding == "cp1252" and not name.isascii())


def test_groups_name_the_bodies_of_an_object(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("o all\n" + obj([("g low", LOW), ("g middle", MIDDLE)]))
    assert [p.name for p in read_parts(tmp_path / "a.obj", "m")] == ["low", "middle"]


@pytest.mark.parametrize("seed", SEEDS)
def test_the_three_bodies_of_a_binary_file_are_three_parts(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    scale = 10 ** rng.uniform(0, 3)
    bodies = [LOW, MIDDLE, TOP]
    corners = np.concatenate([b.vertices[b.faces] for b in bodies]) * scale
    corners = corners[rng.permutation(len(corners))]
    records = np.zeros(len(corners), [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    records["v"] = corners
    head = (b"solid made elsewhere" if seed % 2 else b"").ljust(80, b"\0")
    (tmp_path / "b.stl").write_bytes(head + len(corners).to_bytes(4, "little") + records.tobytes())
    parts = read_parts(tmp_path / "b.stl", "mm")
    assert [p.name for p in parts] == ["b_1", "b_2", "b_3"]
    assert sorted(p.mesh.volume * (1e3 / scale) ** 3 for p in parts) == pytest.approx([1, 1, 4], rel=1e-6)


def test_a_configuration_names_what_the_file_names(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(obj([("o base", LOW), ("o base", MIDDLE), ("o hat", TOP)]))
    (tmp_path / "split.yaml").write_text("model: a.obj\nunits: m\nfixed: [base]\n")
    config = load(tmp_path / "split.yaml")
    assert config.assembly.sequence == ("base_1", "base_2", "hat")
    assert list(config.assembly.fixed) == [True, True, False]
    (tmp_path / "one.yaml").write_text("model: a.obj\nunits: m\nfixed: [base]\nrigid: [base]\n")
    assert load(tmp_path / "one.yaml").assembly.sequence == ("base", "hat")
    (tmp_path / "slip.yaml").write_text("model: a.obj\nunits: m\nfixed: [base]\nrigid: [bases]\n")
    with pytest.raises(InputError, match="rigid names 'bases'"):
        load(tmp_path / "slip.yaml")


def test_one_file_per_part_may_hold_several_bodies(tmp_path: Path) -> None:
    write_part(LOW, tmp_path / "low.obj")
    (tmp_path / "pair.obj").write_text(obj([("o x", MIDDLE), ("o y", TOP)]))
    assert [p.name for p in read_parts(tmp_path, "m")] == ["low", "x", "y"]
    assert [p.name for p in read_parts(tmp_path, "m", rigid=["pair"])] == ["low", "pair"]
