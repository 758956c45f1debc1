"""Loads in files: read, written back bit for bit, and refused by name with a remedy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocca_robot.assembly import Mesh, Part, Polygon
from mocca_robot.errors import InputError
from mocca_robot.files.actions_data import actions_from_data, actions_to_data, combinations_from_data, quantity

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
PARTS = (Part("ground", Polygon(SQUARE - [0.0, 1.0]), fixed=True), Part("plank", Polygon(SQUARE)))
EVERY_KIND: list[dict[str, Any]] = [
    {"name": "person", "kind": "force", "part": "plank", "force": "0.8 kN", "at": [500, 1000]},
    {"name": "push", "kind": "force", "part": "plank", "force": "12.5N", "direction": [3, 4]},
    {"name": "rail", "kind": "line", "part": "plank", "force": "1 kN/m", "start": [0, 1000], "end": [1000, 1000]},
    {"name": "snow", "kind": "pressure", "pressure": "1.5 kN/m²", "facing": "up", "within": [[0, 0], [400, 2000]]},
    {"name": "gas", "kind": "pressure", "pressure": "20 Pa", "parts": ["plank"]},
    {"name": "wind", "kind": "wind", "pressure": "500 Pa", "towards": "-x"},
    {"name": "lamp", "kind": "mass", "part": "plank", "mass": "1500 g", "at": [100, 900]},
    {"name": "worker", "kind": "worker", "mass": "80 kg"},
    {"name": "quake", "kind": "acceleration", "acceleration": "0.1 g", "direction": "+x"},
    {"name": "spreads", "kind": "support", "part": "ground", "shift": "10 mm", "direction": "+x"},
    {"name": "leans", "kind": "support", "part": "ground", "turn": "-2 deg", "about": [0, 100]},
]


def test_every_kind_is_read_in_its_units_and_written_back() -> None:
    actions = actions_from_data(EVERY_KIND, PARTS, 1e-3, "loads")
    found = {a.name: a for a in actions}
    assert found["person"].force.tolist() == [0.0, -800.0] and found["person"].at.tolist() == [0.5, 1.0]  # type: ignore[union-attr]
    assert found["push"].force == pytest.approx([7.5, 10.0])  # type: ignore[union-attr]
    assert found["snow"].pressure_pa == 1500.0 and found["snow"].within.tolist() == [[0.0, 0.0], [0.4, 2.0]]  # type: ignore[union-attr]
    assert found["lamp"].mass_kg == 1.5 and found["wind"].towards.tolist() == [-1.0, 0.0]  # type: ignore[union-attr]
    assert found["quake"].acceleration == pytest.approx([0.980665, 0.0])  # type: ignore[union-attr]
    assert found["spreads"].shift == pytest.approx([0.01, 0.0])  # type: ignore[union-attr]
    assert found["leans"].turn_rad == pytest.approx(np.deg2rad(-2.0))  # type: ignore[union-attr]
    assert found["leans"].about.tolist() == [0.0, 0.1]  # type: ignore[union-attr]
    again = actions_from_data(actions_to_data(actions), PARTS, 1.0, "loads")
    assert actions_to_data(again) == actions_to_data(actions)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"part": "plnk"}, "'plank'"),
        ({"part": "ground"}, "fixed"),
        ({"force": 800}, "without a unit"),
        ({"force": "800"}, "unit"),
        ({"force": "800 kg"}, "N"),
        ({"force": "-3 N"}, "more than 0"),
        ({"force": "nan N"}, "finite"),
        ({"at": [5000, 500]}, "4000 away from part 'plank'"),
        ({"at": [5000, 500]}, "lies within [[0, 0], [1000, 1000]], y up"),
        ({"at": [1, 2, 3]}, "2 numbers"),
        ({"direction": "downwards"}, "'down'"),
        ({"direction": [0, 0]}, "usable length"),
        ({"kind": "farce"}, "'force'"),
        ({"weight": 3}, "unknown key"),
    ],
)
def test_a_load_that_cannot_be_used_is_named(change: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as refused:
        actions_from_data([EVERY_KIND[0] | change], PARTS, 1e-3, "roof.yaml: loads")
    assert words in str(refused.value) and "roof.yaml: load" in str(refused.value)


@given(st.tuples(*[st.floats(-1.5, 1.5)] * 3))
def test_a_place_on_a_solid_is_in_or_on_it(at: tuple[float, float, float]) -> None:
    vertices = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    cube = Part("cube", Mesh(vertices, np.array([t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])])))
    load = {"name": "lamp", "kind": "mass", "part": "cube", "mass": "1 kg", "at": list(at)}
    away = float(np.linalg.norm(np.maximum(np.abs(at) - 1.0, 0.0)))
    if away <= 1e-7:
        assert actions_from_data([load], (cube,), 1.0, "loads")[0].at.tolist() == list(at)  # type: ignore[union-attr]
    elif away > 1e-5:
        with pytest.raises(InputError) as refused:
            actions_from_data([load], (cube,), 1.0, "loads")
        assert f"is {away:.4g} away from part 'cube'" in str(refused.value)


@pytest.mark.parametrize("within", [[[0, -2000], [400, -1]], [[200, 1500], [400, 2000]], [[5000, 0], [9000, 1000]]])
def test_a_box_without_parts_is_refused_with_where_they_are(within: list[list[float]]) -> None:
    snow = EVERY_KIND[3] | {"within": within}
    with pytest.raises(InputError, match="none of its parts") as refused:
        actions_from_data([snow], PARTS, 1e-3, "loads")
    assert "[[0, 0], [1000, 1000]]" in str(refused.value)


def test_names_are_unique_and_needed() -> None:
    with pytest.raises(InputError, match="two loads are called 'worker'"):
        actions_from_data([EVERY_KIND[7]] * 2, PARTS, 1.0, "loads")
    with pytest.raises(InputError, match="needs a name"):
        actions_from_data([{"kind": "worker", "mass": "80 kg"}], PARTS, 1.0, "loads")
    with pytest.raises(InputError, match="needs mass"):
        actions_from_data([{"name": "worker", "kind": "worker"}], PARTS, 1.0, "loads")


def test_without_combinations_each_load_acts_alone() -> None:
    actions = actions_from_data(EVERY_KIND, PARTS, 1e-3, "loads")
    found = combinations_from_data(None, actions, "combinations")
    assert [c.name for c in found] == [a.name for a in actions if a.kind != "support"]
    assert all(c.factors == {c.name: 1.0} and c.gravity == 1.0 for c in found)
    assert [c.name for c in found if c.states == "all"] == ["worker"]


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"name": "use", "factors": {"snwo": 1.5}}, "'snow'"),
        ({"name": "use", "factors": {"snow": 0}}, "more than 0"),
        ({"name": "use", "factors": {"snow": -1.5}}, "more than 0"),
        ({"name": "use"}, "no 'factors'"),
        ({"name": "use", "factors": {}, "states": "some"}, "finished"),
    ],
)
def test_a_combination_that_cannot_be_used_is_named(entry: dict[str, Any], words: str) -> None:
    actions = actions_from_data(EVERY_KIND, PARTS, 1e-3, "loads")
    with pytest.raises(InputError, match="combinations") as refused:
        combinations_from_data([entry], actions, "combinations")
    assert words in str(refused.value)


@given(st.floats(1e-6, 1e9), st.sampled_from(["", " "]), st.sampled_from(["N", "kN", "MN"]))
def test_quantities_are_numbers_with_units(size: float, space: str, unit: str) -> None:
    factor = {"N": 1.0, "kN": 1e3, "MN": 1e6}[unit]
    assert quantity(f"{size!r}{space}{unit}", {"N": 1.0, "kN": 1e3, "MN": 1e6}, "force") == size * factor


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"part": "plank"}, "no support"),
        ({"part": "grund"}, "'ground'"),
        ({"shift": "10"}, "unit"),
        ({"shift": "10 kg"}, "mm"),
        ({"shift": "-1 mm"}, "more than 0"),
        ({"shift": "nan mm"}, "finite"),
        ({"turn": "3"}, "unit"),
        ({"about": [1, 2, 3]}, "2 numbers"),
    ],
)
def test_a_support_that_cannot_move_so_is_named(change: dict[str, Any], words: str) -> None:
    move = {"name": "m", "kind": "support", "part": "ground", "shift": "10 mm", **change}
    with pytest.raises(InputError) as error:
        actions_from_data([move], PARTS, 1e-3, "loads")
    assert words in str(error.value)


def test_a_support_needs_a_move_and_stands_in_no_combination() -> None:
    move = {"name": "m", "kind": "support", "part": "ground"}
    with pytest.raises(InputError, match="says no move"):
        actions_from_data([move], PARTS, 1e-3, "loads")
    with pytest.raises(InputError, match="no shift"):
        actions_from_data([{**move, "turn": "1 deg", "direction": "+x"}], PARTS, 1e-3, "loads")
    actions = actions_from_data([{**move, "shift": "1 mm"}], PARTS, 1e-3, "loads")
    assert combinations_from_data(None, actions, "combinations") == ()
    with pytest.raises(InputError, match="acts alone"):
        combinations_from_data([{"name": "c", "factors": {"m": 1.5}}], actions, "combinations")
