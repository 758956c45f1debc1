"""`mocca-robot/assembly`: written and read back bit for bit, in two and three dimensions; units and order."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mocca_robot.assembly import (
    Assembly,
    Equilibrium,
    Goal,
    Interlocking,
    Lateral,
    Mesh,
    Part,
    Polygon,
    SupportFree,
)
from mocca_robot.errors import InputError
from mocca_robot.files.assembly_json import read_assembly, write_assembly

BOX = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)
FACES = np.array(
    [
        *([0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4]),
        *([1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]),
    ]
)


def flat(seed: int, goals: tuple[Goal, ...] = (Equilibrium(),), alpha: float | None = 0.1) -> Assembly:
    rng = np.random.default_rng(seed)
    parts = []
    for k in range(5):
        angle = np.linspace(0, 2 * np.pi, 7, endpoint=False) + 0.2 * rng.uniform(size=7)
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.uniform(0.5, 1.5) + rng.normal(size=2)
        hole = ring.mean(axis=0) + 0.1 * (ring[::2] - ring.mean(axis=0))
        parts.append(Part(f"Stück {k}", Polygon(ring, (hole,) if k % 2 else (), 0.01 * (k + 1)), 700.0 + k / 3, k == 2))
    return Assembly("Größe / α", tuple(parts), goals, alpha, np.array([0.1, -9.7]))


def solid() -> Assembly:
    rng = np.random.default_rng(8)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    shapes = [Mesh((BOX + np.array([0, 0, k])) @ turn.T / 3, FACES) for k in range(3)]
    names = ("../../escape", "a/b", "A:B")
    return Assembly("tower", tuple(Part(n, s, 1000.0 / 7, n == names[0]) for n, s in zip(names, shapes)))


def require_equal(one: Assembly, other: Assembly) -> None:
    assert one.name == other.name and one.sequence == other.sequence and one.goals == other.goals
    assert one.alpha_rad == other.alpha_rad and (one.gravity == other.gravity).all()
    for a, b in zip(one.parts, other.parts):
        assert (a.fixed, a.density) == (b.fixed, b.density)
        if isinstance(a.shape, Polygon):
            assert isinstance(b.shape, Polygon) and a.shape.thickness == b.shape.thickness
            assert all((r == s).all() for r, s in zip(a.shape.rings, b.shape.rings, strict=True))
        else:
            corners = [np.sort(m.vertices[m.faces].reshape(-1, 9), axis=0) for m in (a.shape, b.shape)]
            assert (corners[0] == corners[1]).all()


@pytest.mark.parametrize("alpha", [None, 0.0, np.deg2rad(5.0), np.deg2rad(25.0), 0.123456789])
@pytest.mark.parametrize(
    "goals",
    [(Equilibrium(),), (SupportFree(), Lateral(np.deg2rad(20.0), 6)), (Interlocking("Stück 3"),)],
)
def test_flat_assemblies_come_back_bit_for_bit(tmp_path: Path, goals: tuple[Goal, ...], alpha: float | None) -> None:
    assembly = flat(1, goals, alpha)
    require_equal(assembly, read_assembly(write_assembly(assembly, tmp_path / "a b é.json")).assembly)


def test_solid_assemblies_come_back_bit_for_bit_and_stay_in_their_folder(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "out"
    require_equal(solid(), read_assembly(write_assembly(solid(), folder / "tower.json")).assembly)
    written = {p.relative_to(folder) for p in tmp_path.rglob("*") if p.is_file()}
    assert len(written) == 4 and all(p.parts[0] in ("tower.json", "tower_parts") for p in written)
    assert len({p.name.lower() for p in written}) == 4


def data(**changes: Any) -> dict[str, Any]:
    square = [[0, 0], [100, 0], [100, 50], [0, 50]]
    parts = [
        {"name": "base", "polygon": square, "fixed": True},
        {"name": "top", "polygon": [[x, y + 50] for x, y in square], "thickness": 7},
    ]
    content = {"format": "mocca-robot/assembly", "version": 1, "units": "mm", "dimension": 2, "name": "n"}
    return {**content, "parts": parts, **changes}


def stored(folder: Path, content: Any) -> Path:
    path = folder / "a.json"
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("cm", 0.01), ("m", 1.0), ("in", 0.0254)])
def test_units_scale_everything_once(tmp_path: Path, unit: str, metres: float) -> None:
    file = read_assembly(stored(tmp_path, data(units=unit)))
    base, top = file.assembly.parts
    assert file.unit == unit
    assert top.shape.volume == pytest.approx(100 * 50 * 7 * metres**3)
    assert isinstance(base.shape, Polygon) and base.shape.thickness == 0.02


def test_a_first_corner_that_is_repeated_at_the_end_is_one_corner(tmp_path: Path) -> None:
    content = data()
    content["parts"][0]["polygon"].append([0, 0])
    assert len(read_assembly(stored(tmp_path, content)).assembly.parts[0].shape.exterior) == 4  # type: ignore[union-attr]


def test_the_sequence_orders_the_parts_and_fixed_ones_come_first(tmp_path: Path) -> None:
    content = data()
    content["parts"].append({"name": "side", "polygon": [[100, 0], [120, 0], [120, 50]]})
    assert read_assembly(stored(tmp_path, content)).assembly.sequence == ("base", "top", "side")
    content["sequence"] = ["side", "top"]
    assert read_assembly(stored(tmp_path, content)).assembly.sequence == ("base", "side", "top")
    content["sequence"] = ["side", "top", "base"]
    assert read_assembly(stored(tmp_path, content)).assembly.sequence == ("base", "side", "top")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"format": "mocca-robot/asembly"}, "mocca-robot/assembly"),
        ({"version": 2}, "version 2.*up to version 1.*Upgrade"),
        ({"version": "one"}, "whole number"),
        ({"units": None}, "units is null"),
        ({"units": "mmm"}, "did you mean 'mm'"),
        ({"dimension": 4}, "dimension is 4"),
        ({"parts": []}, "at least one part"),
        ({"parts": {}}, "list"),
        ({"alpha_deg": 90}, "alpha_deg is 90; it must be .*less than 90"),
        ({"alpha_deg": -1}, "alpha_deg is -1; it must be at least 0"),
        ({"alpha_deg": "5,0"}, "decimal point: 5.0"),
        ({"gravity": [0, 0]}, "gravity.*magnitude"),
        ({"goal": {"kind": "lateral"}}, "angle_deg"),
        ({"goal": {"kind": "lateral", "angle_deg": 90}}, "angle_deg is 90"),
        ({"goal": "suport_free"}, "did you mean 'support_free'"),
        ({"goal": {"kind": "interlocking", "key": "tip"}}, "'tip'.*did you mean 'top'"),
        ({"goal": {"kind": "equilibrium", "key": "top"}}, "unknown key 'key'"),
        ({"sequense": ["base"]}, "did you mean 'sequence'"),
        ({"sequence": ["base", "topp"]}, "'topp'.*did you mean 'top'"),
        ({"sequence": ["base"]}, "leaves out 'top'"),
        ({"sequence": ["top", "top"]}, "'top' 2 times"),
    ],
)
def test_what_an_assembly_has_wrong_is_said(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_assembly(stored(tmp_path, data(**changes)))


@pytest.mark.parametrize("key", ["format", "units", "dimension", "parts"])
def test_what_is_missing_is_named(tmp_path: Path, key: str) -> None:
    content = data()
    del content[key]
    with pytest.raises(InputError, match=key):
        read_assembly(stored(tmp_path, content))


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ({"name": "base"}, "'base' is used by several parts"),
        ({"name": ""}, "1 to 100 printable"),
        ({"name": None}, "must be a name"),
        ({"polygon": [[0, 50], [100, 50]]}, r"'top'.*2 different corners"),
        ({"polygon": [[0, 50], [100, 50], [50, 50]]}, r"'top'.*no area"),
        ({"polygon": [[0, 50], [100, 80], [100, 50], [0, 80]]}, r"'top'.*itself at \(50, 65\) mm"),
        ({"polygon": [[0, 50], [100, "x"], [100, 80]]}, r"'top'.*polygon\[1\]"),
        ({"polygon": [[0, 50], [100], [100, 80]]}, r"'top'.*polygon\[1\].*point"),
        ({"polygon": [[0, 50], [1e300, 50], [100, 80]]}, r"'top'.*polygon\[1\]"),
        ({"polygon": []}, "'top'.*no extent"),
        ({"polygon": "M 0 0"}, "'top'.*list"),
        ({"holes": [[[200, 200], [210, 200], [210, 210]]]}, r"'top'.*hole at \(200, 200\) mm.*not inside"),
        ({"holes": [[[10, 60], [40, 60], [40, 90]], [[20, 62], [39, 62], [39, 80]]]}, "'top'.*holes overlap"),
        ({"thickness": 0}, "'top': thickness is 0"),
        ({"density": -5}, "'top': density is -5"),
        ({"density": True}, "'top': density must be a number"),
        ({"fixed": "no"}, "'top': fixed must be true or false"),
        ({"mesh": "a.obj"}, "'top'.*mesh"),
        ({"colour": "red"}, "unknown key 'colour'"),
    ],
)
def test_what_a_part_has_wrong_is_said(tmp_path: Path, part: dict[str, Any], said: str) -> None:
    content = data()
    content["parts"][1].update(part)
    with pytest.raises(InputError, match=said):
        read_assembly(stored(tmp_path, content))


def test_a_missing_mesh_is_named(tmp_path: Path) -> None:
    content = data(dimension=3, parts=[{"name": "rock", "mesh": "rock.obj"}])
    with pytest.raises(InputError, match=r"rock\.obj"):
        read_assembly(stored(tmp_path, content))
