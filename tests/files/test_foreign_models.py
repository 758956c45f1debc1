"""Models as slicers, older programs and y-up modellers write them: the same two boxes, by name and in place."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from solids import box, rotation

from mocca_robot.assembly import Assembly, Mesh, Part
from mocca_robot.cli.understood import suspicions
from mocca_robot.config.config import load
from mocca_robot.errors import InputError
from mocca_robot.files.mesh_write import write_glb, write_part
from mocca_robot.files.meshes import METRES_PER, read_parts
from mocca_robot.files.threemf import UNITS
from mocca_robot.motion.parts_graph import PartsGraph

SEEDS = range(20)
PLATE, BRICK = box((0, 0, 0), (0.1, 0.1, 0.01)), box((0.01, 0.01, 0.01), (0.05, 0.03, 0.03))
CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"


def mesh_xml(mesh: Mesh, number: int, factor: float) -> str:
    vertices = "".join(f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>' for x, y, z in (mesh.vertices / factor).tolist())
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in np.asarray(mesh.faces).tolist())
    return (
        f'<object id="{number}" type="model"><mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh>'
        "</object>"
    )


def slicer_file(path: Path, seed: int) -> None:
    """Write the two boxes with their meshes in files of their own, placed by components and items."""
    rng = np.random.default_rng(seed)
    unit = sorted(UNITS)[seed % len(UNITS)]
    factor = METRES_PER[UNITS[unit]]
    objects, items, names, files = [], [], [], {}
    for k, (name, mesh) in enumerate((("plate", PLATE), ("brick", BRICK))):
        # What the two transforms do is undone in the mesh.
        turn, shift, lift = rotation(seed + k), rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3)
        inner = Mesh((mesh.vertices - lift - shift) @ turn, mesh.faces)
        files[f"3D/Objects/object_{k}.model"] = (
            f'<model unit="{unit}" xmlns="{CORE}"><resources>{mesh_xml(inner, k + 1, factor)}</resources></model>'
        )
        placed = " ".join(map(repr, [*turn.T.reshape(-1).tolist(), *(shift / factor).tolist()]))
        raised = " ".join(map(repr, [1, 0, 0, 0, 1, 0, 0, 0, 1, *(lift / factor).tolist()]))
        label = f' name="{name}"' if seed % 2 else ""
        objects.append(
            f'<object id="{k + 8}"{label} type="model"><components><component p:path="/3D/Objects/object_{k}.model" '
            f'objectid="{k + 1}" transform="{placed}"/></components></object>'
        )
        items.append(f'<item objectid="{k + 8}" transform="{raised}"/>')
        names.append(f'<object id="{k + 8}"><metadata key="name" value="{name}"/></object>')
    files["3D/3dmodel.model"] = (
        f'<model unit="{unit}" xmlns="{CORE}" xmlns:p="{PRODUCTION}" requiredextensions="p"><resources>'
        f"{''.join(objects)}</resources><build>{''.join(items)}</build></model>"
    )
    files["_rels/.rels"] = (
        '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship '
        'Target="/3D/3dmodel.model" Id="r" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>'
        "</Relationships>"
    )
    files["Metadata/model_settings.config"] = f"<config>{''.join(names)}</config>"
    with zipfile.ZipFile(path, "w") as archive:
        for name in rng.permutation(sorted(files)).tolist():
            archive.writestr(name, files[name])


def assert_boxes(parts: dict[str, Mesh], rel: float = 1e-9) -> None:
    assert set(parts) == {"plate", "brick"}
    for name, mesh in (("plate", PLATE), ("brick", BRICK)):
        assert parts[name].volume == pytest.approx(mesh.volume, rel=rel)
        assert parts[name].bounds == pytest.approx(mesh.bounds, abs=1e-6)


@pytest.mark.parametrize("seed", SEEDS)
def test_meshes_in_files_of_their_own_are_put_in_place(tmp_path: Path, seed: int) -> None:
    slicer_file(tmp_path / "a.3mf", seed)
    assert_boxes({p.name: p.mesh for p in read_parts(tmp_path / "a.3mf")})


@pytest.mark.parametrize(
    ("model", "said"),
    [
        ("<model", "no XML"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><model/>', "entities"),
        ('<model><build><item objectid="4"/></build></model>', "object '4' .* missing"),
        ('<model unit="parsec"/>', "parsec"),
        ("<model/>", "no triangles"),
        (
            '<model><resources><object id="1"><components><component objectid="1"/></components></object></resources>'
            '<build><item objectid="1"/></build></model>',
            "deeper than 10",
        ),
        (
            '<model><resources><object id="1"><mesh><vertices><vertex x="0" y="0" z="0"/></vertices><triangles>'
            '<triangle v1="0" v2="1" v3="2"/></triangles></mesh></object></resources></model>',
            "does not exist",
        ),
    ],
)
def test_broken_models_are_named(tmp_path: Path, model: str, said: str) -> None:
    with zipfile.ZipFile(tmp_path / "a.3mf", "w") as archive:
        archive.writestr("3D/3dmodel.model", model)
    with pytest.raises(InputError, match=rf"a\.3mf.*{said}"):
        read_parts(tmp_path / "a.3mf")


def compas_mesh(mesh: Mesh, name: str, key: str, seed: int) -> dict[str, Any]:
    quads = [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    rng = np.random.default_rng(seed)
    vertex = {str(k): dict(zip("xyz", p)) for k, p in enumerate(mesh.vertices.tolist())}
    face = {str(k): np.roll(quads[q], rng.integers(4)).tolist() for k, q in enumerate(rng.permutation(6))}
    return {
        "dtype": "compas.datastructures/Mesh",
        key: {"attributes": {"name": name}, "vertex": vertex, "face": face},
    }


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("key", ["value", "data"])
def test_lists_of_compas_meshes_are_read_from_either_version(tmp_path: Path, key: str, seed: int) -> None:
    meshes = [compas_mesh(PLATE, "plate", key, seed), compas_mesh(BRICK, "brick", key, seed + 1)]
    nested: Any = [meshes, [meshes], [[meshes[0]], [meshes[1]]]][seed % 3]
    (tmp_path / "a.json").write_text(json.dumps(nested))
    config = load(tmp_path / "a.json")
    assert_boxes({p.name: p.shape for p in config.assembly.parts if isinstance(p.shape, Mesh)})
    assert list(config.assembly.fixed) == [True, False]
    assert any("the lowest stand on the ground: fixed: [plate]" in n for n in config.notes)


@pytest.mark.parametrize("seed", SEEDS)
def test_models_with_y_up_are_turned(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    (tmp_path / "parts").mkdir()
    for name, mesh in (("plate", PLATE), ("brick", BRICK)):
        x, y, z = mesh.vertices.T
        order = rng.permutation(8)
        turned = np.empty((8, 3))
        turned[order] = np.stack([x, z, -y], axis=1)
        write_part(Mesh(turned, order[mesh.faces]), tmp_path / "parts" / f"{name}.obj")
    (tmp_path / "a.yaml").write_text("model: parts\nunits: m\nup: y\nfixed: [plate]\n")
    assert_boxes({p.name: p.shape for p in load(tmp_path / "a.yaml").assembly.parts if isinstance(p.shape, Mesh)})


def test_up_is_refused_where_it_makes_no_sense(tmp_path: Path) -> None:
    write_glb(Assembly("a", (Part("plate", PLATE, fixed=True), Part("brick", BRICK))), tmp_path / "a.glb")
    (tmp_path / "a.yaml").write_text("model: a.glb\nup: y\nfixed: [plate]\n")
    with pytest.raises(InputError, match="GLB files have y up by definition"):
        load(tmp_path / "a.yaml")


@pytest.mark.parametrize(
    "suffix", ["skp", "gh", "blend", "igs", "dwg", "fbx", "gltf", "pdf", "ai", "png", "rvt", "3ds"]
)
def test_formats_that_are_not_read_say_what_to_export(tmp_path: Path, suffix: str) -> None:
    (tmp_path / f"a.{suffix}").write_bytes(b"whatever")
    with pytest.raises(InputError, match=r"is not read here: .*(OBJ|GLB|glb|SVG|DXF|3MF|STEP)"):
        load(tmp_path / f"a.{suffix}")


@pytest.mark.parametrize(
    ("size", "said"),
    [((150.0, 0.02, 0.1), "150 m long and 20 mm thin"), ((6.0, 4.0, 4.4), "weighs 127 t"), ((0.1, 0.1, 0.1), "")],
)
def test_sizes_that_are_more_often_a_slip_are_told(size: tuple[float, float, float], said: str) -> None:
    ground = box((0, 0, -size[2]), (size[0], size[1], 0))
    parts = Part("ground", ground, fixed=True), Part("slab", box((0, 0, 0), size))
    told = [s for s in suspicions(PartsGraph.of(Assembly("a", parts))) if "'slab'" in s]
    assert any(said in s for s in told) if said else told == []
