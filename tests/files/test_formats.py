"""Readers and writers of solid parts, format by format: what each carries, and what changes no verdict in any."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from solids import box, dome, rotation, wall

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh, Part, StatedInterface
from mocca_robot.config.config import load
from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.files import rhino, step
from mocca_robot.files.compas_write import write_compas
from mocca_robot.files.mesh_write import write_glb, write_part
from mocca_robot.files.meshes import FORMATS, read_parts
from mocca_robot.files.rhino import write_3dm
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import load_cases

SEEDS = range(20)
CUBE = box((0, 0, 0), (1, 1, 1))
QUADS = [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
STEP = Path(__file__).with_name("pile.step")
EXACT = {"obj": 1e-12, "ply": 1e-12, "3mf": 1e-12, "3dm": 1e-12, "stl": 1e-6, "glb": 1e-6}
"""What volumes come back to: the first four carry doubles, STL and GLB 32-bit numbers."""


def scene(
    path: Path, nodes: list[dict[str, Any]], meshes: list[list[tuple[Array, Array]]], roots: list[int], **more: Any
) -> None:
    """Write a GLB file: every mesh a list of primitives, each with its vertices and triangles."""
    blob, views, numbers, written = b"", [], [], []
    for primitives in meshes:
        mine = []
        for vertices, faces in primitives:
            for raw, kind, width in ((vertices, "<f4", "VEC3"), (faces.reshape(-1), "<u2", "SCALAR")):
                data = np.asarray(raw, dtype=kind).tobytes()
                views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)})
                numbers.append(
                    {
                        "bufferView": len(views) - 1,
                        "componentType": 5126 if kind == "<f4" else 5123,
                        "count": len(raw),
                        "type": width,
                    }
                )
                blob += data + b"\0" * (-len(data) % 4)
            mine.append({"attributes": {"POSITION": len(numbers) - 2}, "indices": len(numbers) - 1})
        written.append({"primitives": mine})
    data = {**more, "asset": {"version": "2.0"}, "scenes": [{"nodes": roots}], "nodes": nodes, "meshes": written}
    text = json.dumps(
        {**data, "accessors": numbers, "bufferViews": views, "buffers": [{"byteLength": len(blob)}]}
    ).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(blob))
    path.write_bytes(
        head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
    )


def volumes(path: Path, units: str | None = None) -> dict[str, float]:
    return {p.name: p.mesh.volume for p in read_parts(path, units, any_size=True)}


@pytest.mark.parametrize("seed", SEEDS)
def test_glb_scenes_keep_names_places_and_meshes_of_several_primitives(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    scale = float(10 ** rng.uniform(-2, 2))
    cut = int(rng.integers(1, 11))
    order = rng.permutation(12)
    faces = np.asarray(CUBE.faces)[order]
    quaternion = rng.normal(size=4)
    turned = {
        "rotation": (quaternion / np.linalg.norm(quaternion)).tolist(),
        "translation": rng.uniform(-1, 1, 3).tolist(),
    }
    name = ("stone", "Stück", "石", "a b")[seed % 4]
    nodes: list[dict[str, Any]] = [
        {"name": "group", "children": [1, 2], "scale": [scale] * 3, **turned},
        {"name": name, "mesh": 0},
        {"name": "mirrored", "mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]},
        {"name": "empty"},
    ]
    scene(tmp_path / "a.glb", nodes, [[(CUBE.vertices, faces[:cut]), (CUBE.vertices, faces[cut:])]], [3, 0])
    found = volumes(tmp_path / "a.glb")
    assert found == {name: pytest.approx(scale**3, rel=1e-5), "mirrored": pytest.approx(scale**3, rel=1e-5)}


def test_a_glb_that_is_compressed_or_damaged_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.glb"
    scene(file, [{"mesh": 0, "name": "a"}], [[(CUBE.vertices, np.asarray(CUBE.faces))]], [0])
    sound = file.read_bytes()
    draco = {"extensionsUsed": ["KHR_draco_mesh_compression"]}
    scene(file, [{"mesh": 0}], [[(CUBE.vertices, np.asarray(CUBE.faces))]], [0], **draco)
    for broken, said in (
        (file.read_bytes(), "export it again without compression"),
        (sound[:200], "cannot be read as GLB"),
        (sound[:-100], "ends before its meshes do"),
        (b"glTF" + bytes(40), "cannot be read as GLB"),
    ):
        file.write_bytes(broken)
        with pytest.raises(InputError, match=said):
            read_parts(file)


@pytest.mark.parametrize("seed", SEEDS)
def test_ply_files_of_every_kind_are_the_same_part(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = rotation(seed)
    vertices = CUBE.vertices @ turn.T + rng.uniform(-1, 1, 3)
    faces = [np.roll(q, rng.integers(4)).tolist() for q in (QUADS[k] for k in rng.permutation(6))]
    if seed % 3 == 1:  # triangles among quads
        first = faces.pop()
        faces += [first[:3], [first[0], first[2], first[3]]]
    order, number = ("ascii", "binary_little_endian", "binary_big_endian")[seed % 3], ("float", "double")[seed // 3 % 2]
    extra = seed % 2 == 0  # colours before and after the corners
    head = f"ply\nformat {order} 1.0\ncomment made by hand\nelement vertex {len(vertices)}\n"
    head += "".join(f"property {number} {a}\n" for a in "xyz") + ("property uchar red\n" if extra else "")
    head += f"element face {len(faces)}\n" + ("property uchar flags\n" if extra else "")
    head += (
        f"property list uchar {'int' if seed % 4 else 'uint'} vertex_{'index' if seed % 5 else 'indices'}\nend_header\n"
    )
    sign = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[order]
    if sign:
        kind = sign + ("3f" if number == "float" else "3d") + ("B" if extra else "")
        body = b"".join(struct.pack(kind, *v, *([7] if extra else [])) for v in vertices.tolist())
        for f in faces:
            body += (b"\1" if extra else b"") + struct.pack(f"{sign}B{len(f)}i", len(f), *f)
    else:
        rows = [[*map(repr, v), *(["7"] if extra else [])] for v in vertices.tolist()]
        rows += [[*(["1"] if extra else []), str(len(f)), *map(str, f)] for f in faces]
        body = "\n".join(" ".join(r) for r in rows).encode()
    (tmp_path / "cube.ply").write_bytes(head.encode() + body)
    assert volumes(tmp_path / "cube.ply", "m") == {
        "cube": pytest.approx(1.0, rel=1e-5 if number == "float" and sign else 1e-12)
    }


def written(assembly: Assembly, suffix: str, folder: Path) -> Path:
    """Return where the parts are after writing them in a format: a folder, for GLB one file."""
    meshes = [p.shape for p in assembly.parts if isinstance(p.shape, Mesh)]
    if suffix == "glb":
        return write_glb(assembly, folder / "a.glb")
    if suffix == "3dm":
        return write_3dm(assembly.sequence, meshes, folder / "a.3dm")
    (folder / suffix).mkdir()
    for part, mesh in zip(assembly.parts, meshes):
        write_part(mesh, folder / suffix / f"{part.name}.{suffix}", units="mm" if suffix == "stl" else "m")
    return folder / suffix


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("make", [wall, dome])
def test_round_trips_keep_volumes_names_and_units(make: Callable[[], Assembly], suffix: str, tmp_path: Path) -> None:
    if suffix == "3dm":
        pytest.importorskip("rhino3dm")
    turn = rotation(3)
    assembly = make()
    assembly = assembly.with_shapes(
        [Mesh(p.shape.vertices @ turn.T * 1.7, p.shape.faces) for p in assembly.parts if isinstance(p.shape, Mesh)]
    )
    units = {"stl": "mm", "obj": "m", "ply": "m"}.get(suffix)
    again = volumes(written(assembly, suffix, tmp_path), units)
    assert again == {p.name: pytest.approx(p.shape.volume, rel=EXACT[suffix]) for p in assembly.parts}


def verdict(path: Path, settings: str) -> tuple[Any, ...]:
    """Return what is said about the parts in a file: names, what touches what, and whether it stands with friction."""
    file = path.parent / "a.yaml"
    file.write_text(f"model: {path.name}\n{settings}", encoding="utf-8")
    assembly = load(file).assembly
    graph = PartsGraph.of(assembly)
    touching = {frozenset(assembly.parts[p].name for p in c.parts) for c in graph.contacts}
    stands = [solve_case(graph, case, 0.6).result.stands for case in load_cases(graph)]
    return {p.name for p in assembly.parts}, touching, stands


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_motion_a_unit_and_another_order_change_no_verdict(suffix: str, tmp_path: Path) -> None:
    if suffix == "3dm":
        pytest.importorskip("rhino3dm")
    whole = wall(2, 2)  # without the block whose centre lies on an edge: whether it tips is for rounding to say
    exact = replace(whole, parts=tuple(p for p in whole.parts if p.name != "b10"))
    settings = "fixed: [slab]\nalpha_deg: null\nsequence: [b00, b01, b11]\n"
    expected: tuple[Any, ...] | None = None
    for seed in range(3):
        rng = np.random.default_rng(seed)
        angle = rng.uniform(0, 2 * np.pi) if seed else 0.0  # about the vertical: gravity stays where it is
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        shift = rng.uniform(-1, 1, 3) if seed else np.zeros(3)
        parts = []
        for k in rng.permutation(len(exact.parts)) if seed else range(len(exact.parts)):
            part = exact.parts[k]
            assert isinstance(part.shape, Mesh)
            corner = rng.permutation(8) if seed else np.arange(8)
            vertices = np.empty((8, 3))
            vertices[corner] = part.shape.vertices @ turn.T + shift
            faces = np.array([np.roll(corner[f], rng.integers(3)) for f in part.shape.faces])
            parts.append(replace(part, shape=Mesh(vertices, faces[rng.permutation(12)]), fixed=False))
        folder = tmp_path / str(seed)
        folder.mkdir()
        path = written(Assembly("a", tuple(parts)), suffix, folder)
        units = {"stl": "units: mm\n", "obj": "units: m\n", "ply": "units: m\n"}.get(suffix, "")
        found = verdict(path, settings + units)
        expected = expected or found
        assert found == expected
    assert expected is not None and len(expected[1]) == 5 and expected[2] == [True]


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """Read sound files without a process for each, but for the first seed."""
    if request.node.callspec.params["seed"]:
        for module in (step, rhino):
            monkeypatch.setattr(module, "read_apart", lambda kind, path, name, m=module: m.converted(path))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.usefixtures("in_this_process")
def test_step_assemblies_keep_names_places_and_units(tmp_path: Path, seed: int) -> None:
    pytest.importorskip("cascadio")
    rng = np.random.default_rng(seed)
    text = STEP.read_text(encoding="ascii")
    head, _, rest = text.partition("DATA;\n")
    body, _, tail = rest.partition("ENDSEC;")
    entities = [e.strip() + ";" for e in body.split(";\n") if e.strip()]
    # Another order of entities, another unit, other names.
    body = "\n".join(entities[k] for k in rng.permutation(len(entities)))
    prefix, factor = ((".MILLI.", 1.0), (".CENTI.", 10.0), ("$", 1000.0))[seed % 3]
    body = body.replace("SI_UNIT(.MILLI.,.METRE.)", f"SI_UNIT({prefix},.METRE.)")
    name = ("voussoir", "key stone", "b-7")[seed % 3]
    body = body.replace("'brick_left'", f"'{name}'")
    (tmp_path / "a.step").write_text(f"{head}DATA;\n{body}\nENDSEC;{tail}", encoding="ascii")
    found = volumes(tmp_path / "a.step")
    assert found == {
        "slab_1": pytest.approx(1e-4 * factor**3, rel=1e-6),
        name: pytest.approx(1.6e-5 * factor**3, rel=1e-6),
        "brick_right": pytest.approx(1.6e-5 * factor**3, rel=1e-6),
    }


def test_what_is_no_step_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("cascadio")
    for content in (b"", b"whatever", STEP.read_bytes()[:9000]):
        (tmp_path / "a.step").write_bytes(content)
        with pytest.raises(InputError, match=r"cannot be read as STEP|cannot be read as GLB|holds no triangles"):
            read_parts(tmp_path / "a.step")


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.usefixtures("in_this_process")
def test_rhino_files_keep_names_units_blocks_and_layers(tmp_path: Path, seed: int) -> None:
    package = pytest.importorskip("rhino3dm")
    rng = np.random.default_rng(seed)
    unit, metres = (("Millimeters", 1e-3), ("Centimeters", 1e-2), ("Meters", 1.0), ("Inches", 0.0254))[seed % 4]
    size = float(rng.uniform(0.05, 2.0)) / metres
    file = package.File3dm()
    file.Settings.ModelUnitSystem = getattr(package.UnitSystem, unit)
    hidden = package.Layer()
    hidden.Name, hidden.Visible = "construction", False
    shown = package.Layer()
    shown.Name = "Sockel"
    layers = [file.Layers.Add(layer) for layer in (shown, hidden)]

    def mesh(shift: float) -> Any:
        made = package.Mesh()
        for v in CUBE.vertices.tolist():
            made.Vertices.Add(*v)
        made.Vertices.UseDoublePrecisionVertices = True
        for k, (x, y, z) in enumerate((size * (CUBE.vertices + np.array([shift, 0, 0]))).tolist()):
            made.Vertices.SetPoint3dAt(k, package.Point3d(x, y, z))
        for q in QUADS:
            made.Faces.AddFace(*q)
        return made

    for name, layer, shift in (("Stück 1", layers[0], 0.0), ("", layers[0], 2.0), ("helper", layers[1], 4.0)):
        attributes = package.ObjectAttributes()
        attributes.Name, attributes.LayerIndex = name, layer
        file.Objects.AddMesh(mesh(shift), attributes)
    file.Write(str(tmp_path / "a.3dm"), 7)
    parts = read_parts(tmp_path / "a.3dm", any_size=True)
    cube = pytest.approx((size * metres) ** 3, rel=1e-12)
    assert {p.name: p.mesh.volume for p in parts} == {"Stück 1": cube, "Sockel": cube}
    assert any("1 hidden object" in note for p in parts for note in p.notes)


def stacked(curved: bool) -> Assembly:
    """Return a block on a slab, with the interface that its file states: two triangles, or a roof that covers them."""
    slab = Part("slab", box((-1, -1, -0.2), (2, 2, 0.0)), fixed=True)
    flat = np.array([[0.2, 0.2, 0.0], [0.8, 0.2, 0.0], [0.8, 0.8, 0.0], [0.2, 0.8, 0.0]])
    if curved:
        flat = flat + np.array([[0, 0, 0.0], [0, 0, 0.01], [0, 0, 0.0], [0, 0, 0.01]])
    return Assembly("stacked", (slab, Part("block", CUBE)), interfaces=(StatedInterface(("block", "slab"), (flat,)),))


@pytest.mark.parametrize("curved", [False, True])
def test_interfaces_that_a_file_states_are_its_contacts(curved: bool) -> None:
    contacts = find_contacts(stacked(curved)).contacts
    assert len(contacts) == (2 if curved else 1)
    assert all(c.parts == (0, 1) and c.normal[2] > 0.9 for c in contacts)
    assert sum(c.measure for c in contacts) == pytest.approx(0.36, rel=1e-2)
    assert [c.k for c in contacts] == list(range(len(contacts)))


@pytest.mark.parametrize("seed", SEEDS)
def test_compas_interfaces_come_back_whatever_their_order_and_unit(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    assembly = dome(2, 5 + seed % 4) if seed % 2 else wall(2, 2)
    contacts = find_contacts(assembly).contacts
    file = write_compas(assembly, tmp_path / "a.json", contacts)
    data = json.loads(file.read_text(encoding="utf-8"))
    edges = data["data"]["graph"]["data"]["edge"]
    turned: dict[str, dict[str, Any]] = {}
    for u, others in edges.items():
        for v, edge in others.items():
            rng.shuffle(edge["interfaces"])
            a, b = (v, u) if rng.random() < 0.5 else (u, v)
            turned.setdefault(a, {})[b] = edge
            for interface in edge["interfaces"]:
                points = interface["data"]["points"]
                interface["data"]["points"] = points[::-1] if rng.random() < 0.5 else points
    data["data"]["graph"]["data"]["edge"] = turned
    file.write_text(json.dumps(data), encoding="utf-8")
    (tmp_path / "a.yaml").write_text("model: a.json\nunits: cm\nscale: 3\n")
    config = load(tmp_path / "a.yaml")
    again = find_contacts(config.assembly).contacts
    assert any("interfaces that it stores" in note for note in config.notes)
    key = lambda c: (c.parts, np.round(c.normal, 6).tolist())  # noqa: E731
    for a, b in zip(sorted(contacts, key=key), sorted(again, key=key), strict=True):
        assert a.parts == b.parts and b.measure == pytest.approx(a.measure * 9e-4)
        assert a.normal == pytest.approx(b.normal, abs=1e-9)


def test_an_interface_in_the_wrong_place_is_refused() -> None:
    sound = stacked(False)
    far = replace(sound, interfaces=(StatedInterface(("slab", "block"), (sound.interfaces[0].polygons[0] + 5.0,)),))
    with pytest.raises(
        InputError, match=r"stored interface of 'slab' and 'block' lies .* compute the interfaces again"
    ):
        find_contacts(far)


def test_ifc_has_every_part_by_name_with_its_volume_and_mass(tmp_path: Path) -> None:
    ifcopenshell = pytest.importorskip("ifcopenshell")
    from mocca_robot.files.ifc_write import PROPERTIES, write_ifc

    assembly = dome(2, 5)
    file = ifcopenshell.open(str(write_ifc(assembly, tmp_path / "a.ifc")))
    (unit,) = [u for u in file.by_type("IfcSIUnit") if u.UnitType == "LENGTHUNIT"]
    assert unit.Name == "METRE" and unit.Prefix is None
    for part, element in zip(assembly.parts, file.by_type("IfcBuildingElementProxy"), strict=True):
        (shown,) = element.Representation.Representations
        (faces,) = shown.Items
        mesh = Mesh(np.array(faces.Coordinates.CoordList), np.array(faces.CoordIndex) - 1)
        (related,) = element.IsDefinedBy
        properties = related.RelatingPropertyDefinition
        values = {p.Name: p.NominalValue.wrappedValue for p in properties.HasProperties}
        assert element.Name == part.name and mesh.volume == pytest.approx(part.shape.volume, rel=1e-12)
        assert properties.Name == PROPERTIES and values["Fixed"] is part.fixed
        assert values["Mass"] == pytest.approx(part.mass) and values["Step"] == assembly.index(part.name)


def test_a_file_that_ends_its_reader_is_an_error_like_any_other(tmp_path: Path) -> None:
    pytest.importorskip("rhino3dm")
    path = write_3dm(["cube"], [CUBE], tmp_path / "a.3dm")
    content = path.read_bytes()
    for broken in (b"", content[: len(content) // 2], bytes(len(content))):
        path.write_bytes(broken)
        with pytest.raises(InputError, match=r"a\.3dm"):
            read_parts(path)
