"""Configurations: what is written arrives in SI units, defaults come from one table, other files load directly."""

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mocca_robot.assembly import Equilibrium, Interlocking, Lateral, Polygon, SupportFree
from mocca_robot.config import schema
from mocca_robot.config.config import CutOptions, JointOptions, SimulationOptions, load
from mocca_robot.config.keys import options, read_section, section
from mocca_robot.contacts.find import find_contacts, require_sound
from mocca_robot.errors import InputError

SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="100mm" viewBox="0 0 100 100">'
    '<rect id="top" x="10" y="20" width="30" height="10"/><rect id="base" x="10" y="30" width="30" height="10"/>'
    '<rect id="01" x="10" y="10" width="30" height="10"/></svg>'
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "mödel s.svg").write_text(SVG, encoding="utf-8")
    return tmp_path


def config(folder: Path, text: str) -> Path:
    path = folder / "c.yaml"
    path.write_text(f"model: mödel s.svg\nfixed: base\n{text}", encoding="utf-8")
    return path


def test_defaults(folder: Path) -> None:
    loaded = load(config(folder, ""))
    assert loaded.assembly.sequence == ("base", "top", "01")
    assert loaded.assembly.goals == (Equilibrium(),)
    assert loaded.assembly.alpha_rad == pytest.approx(np.deg2rad(5))
    assert (loaded.assembly.gravity == [0, -9.80665]).all()
    assert loaded.joints == JointOptions() and loaded.cut == CutOptions() and loaded.simulate == SimulationOptions()
    assert loaded.unit == "mm" and loaded.notes == ()
    require_sound(loaded.assembly, find_contacts(loaded.assembly))
    assert len(find_contacts(loaded.assembly).contacts) == 2


def test_everything_written_arrives_in_si_units(folder: Path) -> None:
    text = """
name: tower
sequence: [01, top]
goal: [support_free, {kind: lateral, angle_deg: 12.5, azimuths: 4}, {kind: interlocking, key: 01}]
alpha_deg: 1.5e1
density: 700
thickness: 6
parts:
  01: {density: 7e3, thickness: 0.5 in}
  top: {thickness: 9}
gravity: [1, -2]
friction: 0.3
insertion: {top: [0, -5]}
joints: {kinds: n, max_slope_deg: 45, min_radius: 1.5, margin: 0.1, min_contact: 4, tilt_margin_deg: 2,
         max_height: 0.3, min_distance: 2 mm, inset: 0, alpha_margin_deg: 1}
simulate: {azimuths: 16, directions: 12, seed: 7}
cut: {kerf: 0.2, clearance: 0.1, sheet_width: 30 cm, spacing: 3, labels: false}
"""
    loaded = load(config(folder, text))
    base, first, top = loaded.assembly.parts
    assert loaded.assembly.name == "tower" and loaded.assembly.sequence == ("base", "01", "top")
    assert loaded.assembly.goals == (SupportFree(), Lateral(float(np.deg2rad(12.5)), 4), Interlocking("01"))
    assert loaded.assembly.alpha_rad == pytest.approx(np.deg2rad(15))
    assert (first.density, top.density) == (7000.0, 700.0)
    thicknesses = [p.shape.thickness for p in (base, first, top) if isinstance(p.shape, Polygon)]
    assert thicknesses == pytest.approx([6e-3, 0.0127, 9e-3])
    assert (loaded.assembly.gravity == [1, -2]).all()
    assert (loaded.insertion["top"] == [0, -1]).all()
    assert loaded.friction == loaded.simulate.friction == 0.3
    assert loaded.joints == JointOptions(
        kinds=("n",),
        max_slope_rad=float(np.deg2rad(45)),
        min_radius=1.5e-3,
        margin=0.1,
        min_distance=2e-3,
        min_contact=4e-3,
        max_height=0.3,
        tilt_margin_rad=float(np.deg2rad(2)),
        inset=0.0,
        alpha_margin_rad=float(np.deg2rad(1)),
    )
    assert loaded.simulate == SimulationOptions(0.3, 16, 12, 7)
    assert loaded.cut == CutOptions(pytest.approx(2e-4), pytest.approx(1e-4), pytest.approx(0.3), 3e-3, False)


def test_null_alpha_means_not_asked_for_and_other_nulls_mean_absent(folder: Path) -> None:
    assert load(config(folder, "alpha_deg: null")).assembly.alpha_rad is None
    assert load(config(folder, "goal:\ndensity: ~\nsequence: null")).assembly.goals == (Equilibrium(),)


def test_arguments_win_over_the_file_and_every_value_says_where_it_comes_from(folder: Path) -> None:
    loaded = load(config(folder, "alpha_deg: 3\njoints: {margin: 0.2}"), {"alpha_deg": 8})
    assert loaded.assembly.alpha_rad == pytest.approx(np.deg2rad(8))
    values = {v.key: (v.value, v.origin) for v in loaded.values}
    assert values["alpha_deg"] == (8, "argument")
    assert values["joints.margin"] == (0.2, "configuration")
    assert values["joints.inset"] == (JointOptions().inset, "default")


def test_the_table_of_keys_is_complete_and_its_defaults_are_the_real_ones(folder: Path) -> None:
    for prefix, kind in (("joints", JointOptions), ("simulate", SimulationOptions), ("cut", CutOptions)):
        keys = section(schema.KEYS, prefix)
        names = {re.sub("_deg$", "_rad", n) for n in keys}
        assert names == {f.name for f in dataclasses.fields(kind)}
        written = {n: list(k.default) if isinstance(k.default, tuple) else k.default for n, k in keys.items()}
        read = options(kind, read_section(schema.KEYS, written, prefix, "table", 1.0))
        for f in dataclasses.fields(kind):
            assert getattr(read, f.name) == pytest.approx(getattr(kind(), f.name)), f.name
    for key in schema.KEYS:
        assert key.description.endswith(".") and key.kind
    defaults = {k.name: k.default for k in schema.KEYS if "." not in k.name and k.default is not None}
    plain, explicit = load(config(folder, "")), load(config(folder, ""), defaults)
    assert plain.assembly.goals == explicit.assembly.goals
    assert plain.assembly.alpha_rad == explicit.assembly.alpha_rad
    assert (plain.assembly.gravity == explicit.assembly.gravity).all()
    for a, b in zip(plain.assembly.parts, explicit.assembly.parts):
        assert a.density == b.density and a.shape.volume == pytest.approx(b.shape.volume, rel=1e-12)


def test_scale_scales_the_model_but_not_the_lengths_beside_it(folder: Path) -> None:
    one, two = load(config(folder, "thickness: 5")), load(config(folder, "thickness: 5\nscale: 2"))
    assert two.assembly.size == pytest.approx(2 * one.assembly.size)
    assert two.assembly.parts[0].mass == pytest.approx(4 * one.assembly.parts[0].mass)


def test_an_assembly_file_loads_directly_and_its_own_words_count(folder: Path) -> None:
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    content: dict[str, Any] = {
        "format": "mocca-robot/assembly",
        "version": 1,
        "units": "cm",
        "dimension": 2,
        "name": "two",
        "parts": [
            {"name": "a", "polygon": square, "fixed": True},
            {"name": "b", "polygon": [[x, y + 1] for x, y in square]},
        ],
        "goal": "support_free",
        "alpha_deg": None,
    }
    path = folder / "two.json"
    path.write_text(json.dumps(content))
    loaded = load(path)
    assert loaded.assembly.goals == (SupportFree(),) and loaded.assembly.alpha_rad is None
    assert loaded.unit == "cm" and loaded.assembly.size == pytest.approx(np.hypot(0.01, 0.02))
    (folder / "c.yaml").write_text("model: two.json\nthickness: 3\nalpha_deg: 4")
    with_config = load(folder / "c.yaml")
    assert with_config.assembly.alpha_rad == pytest.approx(np.deg2rad(4))
    assert with_config.assembly.parts[0].shape.volume == pytest.approx(0.01**2 * 0.03)


def test_a_folder_of_meshes_loads_with_units_and_fixed_parts(folder: Path) -> None:
    from mocca_robot.assembly import Mesh
    from mocca_robot.files.mesh_write import write_part

    corners = np.array([[x, y, z] for x in (0, 1.0) for y in (0, 1.0) for z in (0, 1.0)])
    faces = np.array(
        [
            *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
            *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
        ]
    )
    blocks = folder / "blocks"
    blocks.mkdir()
    for k in range(2):
        write_part(Mesh(corners + np.array([0, 0, k]), faces), blocks / f"block_{k}.obj")
    with pytest.raises(InputError, match="units"):
        load(blocks)
    with pytest.raises(InputError, match=r"no part is fixed.*fixed: \[block_0\]"):
        load(blocks, {"units": "cm"})
    loaded = load(blocks, {"units": "cm", "fixed": "block_0"})
    assert loaded.assembly.dimension == 3 and loaded.assembly.size == pytest.approx(0.01 * np.sqrt(6))
    assert (loaded.assembly.gravity == [0, 0, -9.80665]).all()
    with pytest.raises(InputError, match="thickness belongs to flat parts"):
        load(blocks, {"units": "cm", "fixed": "block_0", "thickness": 3})


def test_implausible_sizes_are_noted(folder: Path) -> None:
    assert "unit" in load(config(folder, "scale: 100000")).notes[0]
    assert "thick" in load(config(folder, "thickness: 0.02")).notes[0]


@pytest.mark.parametrize("path", sorted((Path(__file__).parents[2] / "configs").glob("*.yaml")), ids=lambda p: p.stem)
def test_every_configuration_of_the_project_loads_without_remarks(path: Path) -> None:
    loaded = load(path)
    assert loaded.assembly.name == path.stem
    assert loaded.notes == ()
