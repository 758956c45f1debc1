"""Exchange: whatever is written for other programs comes back as the same parts, where they can be read again."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from solids import box
from ur_cell import small_plan

from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.config.config import load
from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.fabrication.bill import bill, bill_csv
from mocca_robot.fabrication.walls import thin_places
from mocca_robot.files.assembly_json import write_assembly
from mocca_robot.files.compas_read import assembly_from_compas
from mocca_robot.files.compas_write import write_compas
from mocca_robot.generators import generate
from mocca_robot.geometry.extrusion import surface
from mocca_robot.plan.plan import write_plan
from mocca_robot.plan.trajectory_csv import trajectory_csv

ROOT = Path(__file__).parents[2]


def hollow() -> Polygon:
    """Return a flat part with a corner that points in, and a hole."""
    outline = np.array([[0, 0], [0.1, 0], [0.1, 0.06], [0.05, 0.03], [0, 0.06]])
    hole = np.array([[0.02, 0.01], [0.03, 0.01], [0.03, 0.02]])
    return Polygon(outline, (hole,), 0.01)


def flat() -> Assembly:
    ground = Polygon(np.array([[0, -0.02], [0.1, -0.02], [0.1, 0], [0, 0]]), (), 0.01)
    return Assembly("flat", (Part("ground", ground, 700.0, True), Part("Stück/1", hollow())))


def dome() -> Assembly:
    return generate("dome", {"blocks": [9, 8, 6], "radius": 0.15, "thickness": 0.03})


def same_parts(found: Assembly, expected: Assembly) -> None:
    assert [(p.name, p.fixed, p.density) for p in found.parts] == [(p.name, p.fixed, p.density) for p in expected.parts]
    for a, b in zip(found.parts, expected.parts):
        plate = surface(b)
        assert a.shape.volume == pytest.approx(plate.volume, rel=1e-9)
        assert a.shape.centroid == pytest.approx(plate.centroid, abs=1e-12)
        assert a.shape.bounds == pytest.approx(plate.bounds, abs=1e-12)


@pytest.mark.parametrize("kind", ["assembly", "model"])
@pytest.mark.parametrize("make", [flat, dome])
def test_compas_files_come_back_as_the_same_parts(make: object, kind: str, tmp_path: Path) -> None:
    assembly = make()  # type: ignore[operator]
    contacts = find_contacts(assembly).contacts
    file = write_compas(assembly, tmp_path / "a.json", contacts, kind)
    assert file.read_bytes() == write_compas(assembly, tmp_path / "b.json", contacts, kind).read_bytes()
    again = load(file).assembly
    same_parts(again, assembly)
    assert len(find_contacts(again).contacts) == len(contacts)


@pytest.mark.parametrize("kind", ["assembly", "model"])
def test_compas_itself_reads_what_is_written_and_writes_what_is_read(kind: str, tmp_path: Path) -> None:
    import compas
    from compas.datastructures import Mesh
    from compas_assembly.datastructures import Assembly as CompasAssembly
    from compas_model.models import Model

    assembly = dome()
    file = write_compas(assembly, tmp_path / "a.json", find_contacts(assembly).contacts, kind)
    theirs = compas.json_load(file)
    if kind == "assembly":
        assert isinstance(theirs, CompasAssembly)
        assert list(theirs.graph.nodes_where(is_support=True)) == [k for k, p in enumerate(assembly.parts) if p.fixed]
        blocks = list(theirs.blocks())
        assert [b.volume() for b in blocks] == pytest.approx([p.shape.volume for p in assembly.parts], rel=1e-6)
        assert all(isinstance(b, Mesh) and b.is_manifold() for b in blocks)
        assert len(list(theirs.interfaces())) == len(find_contacts(assembly).contacts)
        compas.json_dump(theirs, tmp_path / "back.json")
        same_parts(load(tmp_path / "back.json").assembly, assembly)
    else:
        # Without compas_dem, COMPAS falls back on the classes that it inherits from.
        assert isinstance(theirs, Model)
        assert [e.name for e in theirs.elements()] == list(assembly.sequence)
        volumes = [e._geometry.volume() for e in theirs.elements()]
        assert volumes == pytest.approx([p.shape.volume for p in assembly.parts], rel=1e-6)


def test_a_compas_assembly_made_there_is_understood_here(tmp_path: Path) -> None:
    import compas
    from compas.geometry import Box
    from compas_assembly.datastructures import Assembly as CompasAssembly
    from compas_assembly.datastructures import Block

    theirs = CompasAssembly(name="pile")
    for k in range(3):
        block = Block.from_shape(Box(1, 1, 1))
        block.translate([0.2 * k, 0, k])
        theirs.add_block(block)
    theirs.graph.node_attribute(0, "is_support", True)
    compas.json_dump(theirs, tmp_path / "pile.json")
    config = load(tmp_path / "pile.json")
    assert config.assembly.sequence == ("block_000", "block_001", "block_002"), "all blocks are called Box there"
    assert list(config.assembly.fixed) == [True, False, False]
    assert [c.measure for c in find_contacts(config.assembly).contacts] == pytest.approx([0.8, 0.8])


def test_compas_interfaces_are_the_contacts(tmp_path: Path) -> None:
    assembly = dome()
    contacts = find_contacts(assembly).contacts
    data = json.loads(write_compas(assembly, tmp_path / "a.json", contacts).read_text())
    edges = data["data"]["graph"]["data"]["edge"]
    found = [i["data"] for a in edges.values() for e in a.values() for i in e["interfaces"]]
    assert sorted(i["size"] for i in found) == pytest.approx(sorted(c.measure for c in contacts))
    frames = np.array([np.cross(i["frame"]["data"]["xaxis"], i["frame"]["data"]["yaxis"]) for i in found])
    assert np.linalg.norm(frames, axis=1) == pytest.approx(np.ones(len(found)))


def test_a_model_is_placed_by_its_groups_and_its_own_transformation() -> None:
    def moved(x: float) -> dict[str, object]:
        return {
            "dtype": "compas.geometry/Translation",
            "data": {"matrix": np.add(np.eye(4), [[0, 0, 0, x], *[[0] * 4] * 3]).tolist()},
        }

    square = {"dtype": "compas.geometry/Polygon", "data": {"points": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]}}
    elements = {
        "g": {"dtype": "compas_model.elements/Group", "data": {"transformation": moved(10), "name": "g"}},
        "p": {
            "dtype": "compas_model.elements/PlateElement",
            "data": {"polygon": square, "thickness": 0.5, "transformation": moved(1), "name": "plate"},
        },
        "b": {
            "dtype": "compas_model.elements/BeamElement",
            "data": {"width": 1, "depth": 2, "length": 3, "transformation": None, "name": "beam"},
        },
    }
    tree = {"root": {"name": "root", "children": [{"element": "g", "children": [{"element": "p"}]}, {"element": "b"}]}}
    data = {
        "dtype": "compas_model.models/Model",
        "data": {"transformation": moved(100), "elements": elements, "tree": tree},
    }
    assembly, _ = assembly_from_compas(data, "m", "'m.json'", 1e-3)
    plate, beam = assembly.parts
    assert plate.shape.bounds * 1e3 == pytest.approx(np.array([[111, 0, -0.5], [112, 1, 0]]))
    assert beam.shape.bounds * 1e3 == pytest.approx(np.array([[99.5, -1, 0], [100.5, 1, 3]]))
    assert plate.shape.volume > 0 and beam.shape.volume == pytest.approx(6e-9)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"dtype": "compas_assembly.datastructures/Assembly", "value": {}}, 'has no "graph"'),
        ({"dtype": "compas_assembly.datastructures/Assembly"}, 'has no "data"'),
        ({"dtype": "compas.geometry/Box", "data": {}}, "Save one of these"),
        ({"dtype": 7, "data": {}}, "must be a text"),
        ({"dtype": "x/Assembly", "data": {"graph": {"node": {}}}}, "holds no block"),
        ({"dtype": "x/Assembly", "data": {}}, 'no "graph"'),
        ({"dtype": "x/Model", "data": {"elements": {"a": {"dtype": "y/Element", "data": {}}}}}, "without a shape"),
        ([{"dtype": "x/Mesh", "data": {"vertex": {"0": {"x": "1"}}, "face": {}}}], "must be a number"),
        ([{"dtype": "x/Mesh", "data": {"vertex": {"0": {}}, "face": {"0": [0, 1, 2]}}}], "must list vertices"),
    ],
)  # fmt: skip
def test_broken_compas_files_are_named(data: object, said: str) -> None:
    with pytest.raises(InputError, match=said):
        assembly_from_compas(data, "a", "'a.json'", 1.0)


@pytest.mark.parametrize(("kind", "unit"), [("obj", "m"), ("stl", "mm"), ("ply", "m"), ("3mf", None), ("glb", None)])
@pytest.mark.parametrize("make", [flat, dome])
def test_meshes_come_back_as_the_same_parts(make: object, kind: str, unit: str | None, tmp_path: Path) -> None:
    assembly = make()  # type: ignore[operator]
    source = write_assembly(assembly, tmp_path / "a.json")
    target = tmp_path / ("a.glb" if kind == "glb" else "parts")
    assert main(["export", str(source), "--format", kind, "-o", str(target), "--min-wall", "0"]) == 0
    fixed = [p.name for p in assembly.parts if p.fixed]
    names = fixed if kind == "glb" else [n.replace("ü", "_").replace("/", "_") for n in fixed]
    again = load(target, {"fixed": names, **({"units": unit} if unit else {})}).assembly
    assert sorted(p.shape.volume for p in again.parts) == pytest.approx(
        sorted(surface(p).volume for p in assembly.parts), rel=1e-4
    )
    assert len(find_contacts(again).contacts) == len(find_contacts(assembly).contacts) or kind in (
        "stl",
        "glb",
        "ply",
        "3mf",
    )


def test_cutting_drawings_come_back_and_dxf_holds_the_same_lengths(tmp_path: Path) -> None:
    import ezdxf

    source = write_assembly(flat(), tmp_path / "a.json")
    for kind in ("svg", "dxf"):
        assert (
            main(["export", str(source), "--format", kind, "-o", str(tmp_path / f"a.{kind}"), "--min-wall", "0"]) == 0
        )
    again = load(tmp_path / "a.svg", {"fixed": ["ground"], "thickness": 10}).assembly
    assert {p.name: p.shape.volume for p in again.parts} == pytest.approx(
        {p.name: p.shape.volume for p in flat().parts}, rel=1e-6
    )
    lines = ezdxf.readfile(tmp_path / "a.dxf").modelspace().query("LWPOLYLINE")
    edges = [np.diff(np.array([*p, p[0]]), axis=0) for p in ([v[:2] for v in line.get_points()] for line in lines)]
    found = sum(float(np.linalg.norm(e, axis=1).sum()) for e in edges)
    rings = [r for p in flat().parts for r in p.shape.rings]  # type: ignore[union-attr]
    assert found == pytest.approx(1e3 * sum(np.linalg.norm(r - np.roll(r, 1, axis=0), axis=1).sum() for r in rings))


def test_trajectories_are_the_plans_waypoints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = small_plan(2)
    rows = list(csv.DictReader(io.StringIO(trajectory_csv(plan))))
    points = [w for s in plan.steps for m in s.moves for w in m.path]
    assert len(rows) == len(points)
    for row, w in zip(rows, points):
        assert [float(row[f"q{k}_rad"]) for k in range(1, 7)] == list(w.q)
        assert [float(row[k]) for k in ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")] == list(w.tcp)
    times = [float(r["t_s"]) for r in rows]
    assert times == sorted(times) and times[0] == 0.0
    write_plan(plan, tmp_path / "plan.json")
    assert main(["export", str(tmp_path / "plan.json"), "--format", "csv"]) == 0
    assert (tmp_path / "plan.csv").read_text() == trajectory_csv(plan)


def test_equal_parts_are_counted_together() -> None:
    wall = generate("wall", {"courses": 3, "columns": 3})
    items = bill(wall)
    assert sum(len(i.names) for i in items) == len(wall.parts)
    assert len(items) < len(wall.parts)
    assert sum(i.mass_kg * len(i.names) for i in items) == pytest.approx(sum(p.mass for p in wall.parts))
    rows = list(csv.DictReader(io.StringIO(bill_csv(wall))))
    assert [int(r["count"]) for r in rows] == [len(i.names) for i in items]


def test_walls_are_measured_in_the_plane_and_in_space() -> None:
    neck = np.array([[0, 0], [0.04, 0], [0.04, 0.0195], [0.06, 0.0195], [0.06, 0], [0.1, 0], [0.1, 0.04], [0.06, 0.04],
                     [0.06, 0.0205], [0.04, 0.0205], [0.04, 0.04], [0, 0.04]])  # fmt: skip
    plate = Assembly("a", (Part("dumbbell", Polygon(neck)), Part("hollow", hollow(), fixed=True)))
    (found,) = thin_places(plate, 0.002)
    assert (found.part, found.kind) == ("dumbbell", "wall")
    assert found.thickness == pytest.approx(0.001, rel=0.05)
    assert 0.04 <= found.place[0] <= 0.06 and found.place[1] == pytest.approx(0.02, abs=2e-4)
    slot = np.array(
        [[0, 0], [0.1, 0], [0.1, 0.05], [0.0505, 0.05], [0.0505, 0.02], [0.0495, 0.02], [0.0495, 0.05], [0, 0.05]]
    )
    (found,) = thin_places(Assembly("b", (Part("cleft", Polygon(slot)), Part("hollow", hollow(), fixed=True))), 0.002)
    assert found.kind == "slot" and found.thickness == pytest.approx(0.001, rel=0.05)
    sheet = Assembly(
        "c",
        (
            Part("sheet", box((0, 0, 0), (0.1, 0.1, 0.0006)), fixed=True),
            Part("cube", box((0, 0, 0.01), (0.05, 0.05, 0.06))),
        ),
    )
    (found,) = thin_places(sheet, 0.0008)
    assert found.part == "sheet" and found.thickness == pytest.approx(0.0006)
    assert thin_places(sheet, 0.0005) == []


def test_thin_walls_are_warned_of_as_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_assembly(dome(), tmp_path / "a.json")
    arguments = ["export", str(source), "--format", "stl", "--bed", "220x220", "-o", str(tmp_path / "beds"), "--json"]
    assert main(arguments) == 0
    assert json.loads(capsys.readouterr().out)["warnings"] == []
    assert main([*arguments, "--scale", "0.02"]) == 0
    (first, *_) = json.loads(capsys.readouterr().out)["warnings"]
    assert "limit is 0.8 mm" in first
    assert 0.4 < float(first.partition("wall of ")[2].split()[0]) <= 0.6, "30 mm thick blocks at 1:50"
