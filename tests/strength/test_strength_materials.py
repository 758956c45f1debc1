"""Materials: the table, own materials, directions, and what is refused."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

from mocca_robot.config.config import load
from mocca_robot.errors import InputError
from mocca_robot.strength.materials import FIGURES, KNOWN, TABLE, materials_from_data
from mocca_robot.strength.options import made_of, other_weights

SHELF = """{"format": "mocca-robot/assembly", "version": 1, "units": "m", "dimension": 2, "name": "shelf",
 "alpha_deg": null, "parts": [
 {"name": "left", "fixed": true, "polygon": [[0, 0], [0.1, 0], [0.1, 0.5], [0, 0.5]]},
 {"name": "right", "fixed": true, "polygon": [[0.9, 0], [1, 0], [1, 0.5], [0.9, 0.5]]},
 {"name": "board", "thickness": 0.3, "polygon": [[0, 0.5], [1, 0.5], [1, 0.52], [0, 0.52]]}]}"""
MIX = "density: 1100 kg/m³, stiffness: 4 GPa, poisson: 0.2, tension: 2 MPa, compression: 6 MPa"


def shelf(folder: Path, text: str) -> Path:
    """Return a configuration of a board on two posts with further keys."""
    (folder / "shelf.json").write_text(SHELF, encoding="utf-8")
    path = folder / "shelf.yaml"
    path.write_text(f"model: shelf.json\n{text}\n", encoding="utf-8")
    return path


def test_every_figure_of_the_table_has_a_source_and_is_plausible():
    assert len(TABLE) == 15
    for m in TABLE:
        assert set(FIGURES) <= set(m.sources) and all(m.sources.values()), m.name
        assert 0.0 < m.strength.tension <= 1.5 * m.strength.compression < 0.05 * m.stiffness
        assert -1.0 < m.poisson < 0.5 and 400 < m.density < 3000 and m.bearing > 0.0
        assert (m.across is None) == (m.direction == "") and m.weakest.tension <= m.strength.tension


def test_own_materials_come_with_units_and_go_first(tmp_path):
    config = load(shelf(tmp_path, f"materials: {{oak: {{{MIX}, shear: 1.5 MPa}}}}\nmaterial: oak\nstrength: {{}}"))
    made = made_of(config.assembly, config.strength)[0]
    assert made.strength.tension == 2e6 and made.strength.shear == 1.5e6 and made.material.bearing == 6e6
    assert config.assembly.parts[-1].density == 1100.0


def test_the_density_is_that_of_the_material_unless_another_is_given(tmp_path):
    assert load(shelf(tmp_path, "material: marble")).assembly.parts[2].density == KNOWN["marble"].density
    assert load(shelf(tmp_path, "material: marble\ndensity: 2000")).assembly.parts[2].density == 2000.0
    assert load(shelf(tmp_path, "material: wood")).assembly.parts[2].density == 1200.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("material: plastr\nstrength: {safety: 2}", "did you mean 'plaster'"),
        ("material: oak\ngrain: []", "grain: \\[1, 0\\]"),
        ("material: pla\ngrain: up", "no part is of a material with grain"),
        ("material: pla\nparts: {board: {grain: up}}", "pla has layers; remove grain"),
        ("material: marble\nparts: {board: {layers: up}}", "same in every direction"),
        ("material: marble\nstrength: {safety: 0}", "at least 1"),
        ("strength: {grip_force: 30}", "without a unit; write '800 N'"),
        (f"materials: {{mix: {{{MIX.replace('2 MPa', '30')}}}}}", "tension is 30, without a unit"),
        (f"materials: {{mix: {{{MIX.replace('2 MPa', '0 MPa')}}}}}", "tension is 0; it must be more than 0"),
        (f"materials: {{mix: {{{MIX.replace('2 MPa', '-3 MPa')}}}}}", "must be more than 0"),
        (f"materials: {{mix: {{{MIX.replace('2 MPa', '30 GPa')}}}}}", "a unit is mixed up"),
        (f"materials: {{mix: {{{MIX.replace('2 MPa', '30 N')}}}}}", "tension is '30 N'.*MPa"),
        (f"materials: {{mix: {{{MIX.replace('0.2', '0.5')}}}}}", "poisson is 0.5; it must be .* less than 0.5"),
        (f"materials: {{mix: {{{MIX.replace('0.2', '-1')}}}}}", "poisson is -1; it must be more than -1"),
        (f"materials: {{mix: {{{MIX}, direction: grain}}}}", "'across'"),
        (f"materials: {{mix: {{{MIX}, across: {{tension: 1 MPa, compression: 2 MPa}}}}}}", "'direction'"),
        ("materials: {mix: {density: 1100 kg/m³}}", "has no 'stiffness'"),
        (f"materials: {{mix: {{{MIX}, tensoin: 3 MPa}}}}", "did you mean 'tension'"),
    ],
)
def test_bad_input_is_named_with_a_remedy(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        load(shelf(tmp_path, text))


def test_wood_needs_its_grain_and_a_print_without_layers_is_weak_everywhere(tmp_path):
    bare = load(shelf(tmp_path, "material: oak"))
    with pytest.raises(InputError, match=r"30 times as strong.*grain: \[1, 0\]"):
        made_of(bare.assembly, bare.strength)
    grained = load(shelf(tmp_path, "material: oak\ngrain: +x"))
    board = made_of(grained.assembly, grained.strength)[2]
    assert board.along is not None and board.along.tension == 18e6 and board.strength.tension == 0.6e6
    np.testing.assert_array_equal(board.axis, [1.0, 0.0])
    printed = load(shelf(tmp_path, "material: pla"))
    weak = made_of(printed.assembly, printed.strength)[2]
    assert weak.strength.tension == 17e6 and "layers" in weak.note
    lying = load(shelf(tmp_path, "material: pla\nlayers: flat"))
    assert made_of(lying.assembly, lying.strength)[2].strength.tension == 50e6


@pytest.mark.parametrize(("density", "said"), [("", False), ("density: 1150", False), ("density: 2000", True)])
def test_a_given_density_far_from_that_of_the_material_is_told(tmp_path, density, said):
    config = load(shelf(tmp_path, f"material: plaster\n{density}"))
    notes = other_weights(config.assembly, made_of(config.assembly, config.strength))
    assert bool(notes) is said
    if said:
        assert "'board' of plaster" in notes[0] and "2000" in notes[0]
        remedy = {"density": float(notes[0].split("--set density=")[1])}
        mended = load(tmp_path / "shelf.yaml", remedy).assembly
        assert not other_weights(mended, made_of(mended, config.strength))


def test_a_grain_nobody_told_can_be_told_on_the_command_line(tmp_path):
    path = shelf(tmp_path, "material: oak")
    bare = load(path)
    with pytest.raises(InputError) as caught:
        made_of(bare.assembly, bare.strength)
    key, value = str(caught.value).split("--set '")[1].split("'")[0].split("=")
    told = load(path, {key: ast.literal_eval(value)})
    assert made_of(told.assembly, told.strength)[2].axis is not None


@pytest.mark.parametrize(("value", "said"), [("", "null"), ("true", "true"), ("abc", "'abc'")])
def test_values_are_said_as_one_writes_them(tmp_path, value, said):
    with pytest.raises(InputError, match=f"strength.safety must be a number, not {said}"):
        load(shelf(tmp_path, f"strength: {{safety: {value}}}"))


def test_a_part_without_material_is_named(tmp_path):
    plain = load(shelf(tmp_path, "name: bare"))
    with pytest.raises(InputError, match="'board' has no material"):
        made_of(plain.assembly, plain.strength)


def test_own_materials_must_be_a_mapping():
    with pytest.raises(InputError, match="must be a mapping"):
        materials_from_data([1], "x: materials")
