"""`mocca-robot/design`: exact geometry, everything a reader was promised, and nothing half written."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Lateral, Mesh, Part, Polygon, SupportFree
from mocca_robot.config import config
from mocca_robot.contacts.find import find_contacts
from mocca_robot.design import CaseResult, Design, Insertion
from mocca_robot.errors import EnvironmentNeeded, InputError
from mocca_robot.files.design_json import read_design, write_design
from mocca_robot.files.output import make_folder, safe_file_names, write_atomic
from mocca_robot.joints.build2d import build_parts_2d
from mocca_robot.joints.joint import Joint, planar

BOX = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)
FACES = np.array(
    [
        *([0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4]),
        *([1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]),
    ]
)


@pytest.fixture
def flat() -> Design:
    """Two blocks with one n-type joint between them, turned by an odd angle."""
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[c, s], [-s, c]])
    square = np.array([[0.0, 0], [1, 0], [1, 0.7], [0, 0.7]]) / 3
    shapes = [Polygon((square + np.array([0, 0.7 / 3 * k])) @ turn, (), 0.013) for k in range(2)]
    source = Assembly(
        "zwei Blöcke",
        (Part("base", shapes[0], 700 / 3, True), Part("top", shapes[1], 900.0)),
        (SupportFree(), Lateral(np.deg2rad(7.0), 4)),
        float(np.deg2rad(12.0)),
    )
    (contact,) = find_contacts(source).contacts
    t = np.linspace(0, 1, 19)[:, None]
    points = contact.polygon[0] * (1 - t) + contact.polygon[1] * t + 0.03 * np.sin(np.pi * t) ** 2 * contact.normal
    points[-1] = contact.polygon[1]
    facets = np.stack([np.arange(18), np.arange(1, 19)], axis=1)
    joint = Joint(
        contact=contact,
        kind="n",
        direction=contact.normal,
        vertices=points,
        facets=facets,
        parameters={"height": 0.1, "a": 1 / 3},
    )
    built = build_parts_2d(source, [joint])
    case = CaseResult("gravity", 0.3, 1e-12)
    insertion = Insertion("top", -contact.normal, float(np.deg2rad(12.0)))
    return Design(
        source=source,
        assembly=built,
        joints=(joint,),
        insertion=(insertion,),
        load_cases=(case,),
        seconds={"kinematic": 0.1, "total": 0.2},
        notes=("fine",),
    )


@pytest.fixture
def solid() -> Design:
    meshes = [Mesh((BOX + np.array([0, 0, k])) / 7, FACES) for k in range(2)]
    parts = (Part("Fuß/../..", meshes[0], fixed=True), Part("Kopf", meshes[1]))
    source = Assembly("solid", parts, alpha_rad=None)
    return Design(
        source=source,
        assembly=source,
        joints=(),
        insertion=(Insertion("Kopf", np.array([0.0, 0, -1]), 0.5),),
        load_cases=(),
    )


def test_a_flat_design_comes_back_bit_for_bit(flat: Design, tmp_path: Path) -> None:
    read = read_design(write_design(flat, tmp_path / "out"))
    for mine, back in ((flat.assembly, read.assembly), (flat.source, read.source)):
        assert back is not None
        assert back.name == mine.name and back.sequence == mine.sequence
        assert back.goals == mine.goals and back.alpha_rad == mine.alpha_rad
        assert (back.gravity == mine.gravity).all()
        for a, b in zip(mine.parts, back.parts):
            assert (a.shape.exterior == b.shape.exterior).all()  # type: ignore[union-attr]
            assert (a.density, a.fixed, a.shape.volume) == (b.density, b.fixed, b.shape.volume)
    assert read.load_cases == flat.load_cases and read.seconds == flat.seconds and read.notes == flat.notes
    assert read.features == ("equilibrium", "support_free", "lateral")
    (insertion,), (joint,) = read.insertion, read.joints
    assert insertion.part == "top" and insertion.alpha_rad == flat.insertion[0].alpha_rad
    assert np.allclose(insertion.direction, flat.insertion[0].direction, atol=1e-15)
    assert joint.parts == ("base", "top") and joint.kind == "n" and joint.parameters == flat.joints[0].parameters


def test_neighbours_still_share_their_curve_exactly(flat: Design, tmp_path: Path) -> None:
    base, top = read_design(write_design(flat, tmp_path)).assembly.parts
    shared = {tuple(p) for p in base.shape.exterior} & {tuple(p) for p in top.shape.exterior}  # type: ignore[union-attr]
    assert len(shared) == len(flat.joints[0].vertices)


def test_the_file_is_what_was_promised_to_other_programs(flat: Design, tmp_path: Path) -> None:
    data = json.loads(write_design(flat, tmp_path).read_text("utf-8"))
    assert data["format"] == "mocca-robot/design" and data["version"] == 1
    assert data["units"] == "m" and data["dimension"] == 2 and data["gravity"] == [0.0, -9.80665]
    assert data["sequence"] == ["base", "top"] and data["insertion"][0]["alpha_deg"] == 12.0
    assert set(data["parts"][0]) == {"name", "fixed", "density", "polygon", "thickness"}
    assert set(data["joints"][0]) == {"parts", "type", "principal_direction", "parameters"}
    assert data["source"]["format"] == "mocca-robot/assembly"
    assert data["source"]["goal"][1] == {"kind": "lateral", "angle_deg": 7.0, "azimuths": 4}


def test_solid_parts_are_meshes_beside_the_file_and_never_elsewhere(solid: Design, tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    path = write_design(solid, folder)
    files = {str(p.relative_to(folder)) for p in tmp_path.rglob("*") if p.is_file()}
    meshes = {p["mesh"] for p in json.loads(path.read_text("utf-8"))["parts"]}
    assert meshes == {"parts/Fu_.._...obj", "parts/Kopf.obj"} or len(meshes) == 2
    assert files == {"design.json"} | meshes | {m.replace("parts/", "source/") for m in meshes}
    read = read_design(folder)
    for a, b in zip(solid.assembly.parts, read.assembly.parts):
        assert isinstance(a.shape, Mesh) and isinstance(b.shape, Mesh)
        assert b.shape.volume == pytest.approx(a.shape.volume, rel=1e-12)
        assert {tuple(v) for v in a.shape.vertices} == {tuple(v) for v in b.shape.vertices}
    assert read.assembly.alpha_rad is None


def test_a_design_loads_as_a_configuration_with_its_goals_and_directions(flat: Design, tmp_path: Path) -> None:
    path = write_design(flat, tmp_path)
    for given in (path, tmp_path):
        loaded = config.load(given)
        assert loaded.assembly.goals == flat.source.goals
        assert np.allclose(loaded.insertion["top"], flat.insertion[0].direction)
        assert len(loaded.assembly.parts[1].shape.exterior) > 10  # type: ignore[union-attr]


def test_writing_twice_gives_the_same_bytes_and_leaves_no_temporary_files(solid: Design, tmp_path: Path) -> None:
    first = write_design(solid, tmp_path).read_bytes()
    assert write_design(solid, tmp_path).read_bytes() == first
    assert not list(tmp_path.rglob(".*"))


def test_an_interrupted_write_leaves_the_old_design(
    flat: Design, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = write_design(flat, tmp_path).read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(EnvironmentNeeded, match="No space left"):
        write_design(replace(flat, notes=("new",)), tmp_path)
    monkeypatch.undo()
    assert (tmp_path / "design.json").read_bytes() == old
    assert [p.name for p in tmp_path.iterdir()] == ["design.json"]


def test_a_folder_that_cannot_be_written_is_said_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for impossible in (tmp_path / "file" / "out", tmp_path / ("x" * 300), Path("/proc/out")):
        with pytest.raises(EnvironmentNeeded, match="-o DIR"):
            make_folder(impossible)
    with pytest.raises(EnvironmentNeeded, match="cannot be written"):
        write_atomic(tmp_path / "file" / "out.json", "x")


def test_file_names_are_safe_and_distinct() -> None:
    names = [
        "../../etc/passwd",
        "a/b",
        "a\\b",
        "A/B",
        "NUL",
        "con.txt",
        ".hidden",
        "-rf",
        "é",
        "ü",
        "x" * 200,
        "",
        "ok",
    ]
    stems = safe_file_names(names)
    assert len({s.lower() for s in stems.values()}) == len(names) and stems["ok"] == "ok"
    for stem in stems.values():
        assert Path(stem).name == stem and stem[0] not in ".-" and stem.isascii() and len(stem) < 80
    assert not {s.lower().split(".")[0] for s in stems.values()} & {"nul", "con"}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"version": 3}, "version 3.*Upgrade"),
        ({"format": "mocca-robot/plan"}, "mocca-robot/design"),
        ({"sequence": ["base"]}, "leaves out 'top'"),
        ({"insertion": [{"part": "topp", "direction": [0, 1], "alpha_deg": 1}]}, "did you mean 'top'"),
        ({"insertion": [{"part": "top", "direction": [0, 0], "alpha_deg": 1}]}, "direction"),
        ({"insertion": [{"part": "top", "direction": [0, 1]}]}, 'no "alpha_deg"'),
        ({"joints": [{"parts": ["base"]}]}, "joints"),
        ({"load_cases": 3}, "load_cases must be a list"),
        ({"seconds": {"total": "fast"}}, r"seconds\.total"),
        ({"source": []}, "source must be a mapping"),
        ({"extra": 1}, "unknown key 'extra'"),
    ],
)
def test_a_broken_design_is_refused(flat: Design, tmp_path: Path, change: dict[str, object], said: str) -> None:
    path = write_design(flat, tmp_path)
    path.write_text(json.dumps({**json.loads(path.read_text("utf-8")), **change}))
    with pytest.raises(InputError, match=said):
        read_design(path)


def test_planar_joints_are_written_too(flat: Design, tmp_path: Path) -> None:
    kept = replace(flat, joints=(planar(flat.joints[0].contact),), assembly=flat.source)
    (joint,) = read_design(write_design(kept, tmp_path)).joints
    assert joint.kind == "planar" and joint.parameters == {}
