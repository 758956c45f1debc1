"""Contact pressures and the fast estimate against closed forms; the whole question on small assemblies."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from mocca_robot.actions import Combination, PointForce
from mocca_robot.assembly import Assembly, Mesh, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.errors import InputError
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.loads import load_cases
from mocca_robot.strength.assess import assess
from mocca_robot.strength.bedding import Bed, pressed
from mocca_robot.strength.cuts2d import cuts2d
from mocca_robot.strength.cuts3d import cuts3d
from mocca_robot.strength.estimate import NOTCH
from mocca_robot.strength.options import StrengthOptions
from mocca_robot.strength.scale import largest_scale
from mocca_robot.strength.strength_json import read_strength, strength_to_data, write_strength

G = 9.80665
LENGTH, HEIGHT, THICK, REST = 1.0, 0.05, 0.1, 0.02


def rectangle(x: float, y: float, width: float, height: float) -> Polygon:
    """Return a rectangle by its lower left corner."""
    return Polygon(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]))


def box(low: tuple[float, ...], high: tuple[float, ...]) -> Mesh:
    """Return a box from corner to corner."""
    import trimesh

    made = trimesh.creation.box(bounds=[low, high])
    return Mesh(np.array(made.vertices), np.array(made.faces))


def beam(force: float = 0.0) -> Assembly:
    """Return a plaster beam on two narrow posts, with a force in the middle of its top."""
    posts = [
        Part("a", rectangle(0.0, -0.2, REST, 0.2), fixed=True),
        Part("b", rectangle(LENGTH - REST, -0.2, REST, 0.2), fixed=True),
    ]
    shape = replace(rectangle(0.0, 0.0, LENGTH, HEIGHT), thickness=THICK)
    made = Assembly("beam", (*posts, Part("beam", shape, 1100.0, material="plaster")), alpha_rad=None)
    if not force:
        return made
    load = PointForce(name="p", part="beam", force=np.array([0.0, -force]), at=np.array([LENGTH / 2, HEIGHT]))
    return replace(made, actions=(load,), combinations=(Combination(name="p", factors={"p": 1.0}),))


def test_a_block_off_its_centre_presses_as_a_trapeze_and_then_as_a_triangle():
    for arm, peak in ((0.1, 1.6), (0.3, 10.0 / 3.0)):  # p/p0 = 1 + 6 e/b, beyond the kern 2/(3 (1/2 − e/b))
        block = Part("block", rectangle(0.0, 0.0, 1.0, 0.2), 1000.0)
        load = PointForce(name="p", part="block", force=np.array([0.0, -1e6]), at=np.array([0.5 + arm, 0.2]))
        made = Assembly(
            "kern", (Part("ground", rectangle(-1, -1, 3, 1), fixed=True), block), alpha_rad=None, actions=(load,),
            combinations=(Combination(name="p", factors={"p": 1.0}),),
        )  # fmt: skip
        graph = PartsGraph.of(made)
        bed = Bed.of(graph)
        found = pressed(bed, graph, load_cases(graph)[-1])
        assert found.balanced
        pressure = np.linalg.norm(found.forces, axis=1) / bed.areas * block.shape.thickness
        assert pressure.max() == pytest.approx(peak * 1e6, rel=0.04)


def test_the_estimate_of_a_beam_is_the_closed_form_times_the_notch_factor():
    force = 100.0
    found = assess(PartsGraph.of(beam(force)), StrengthOptions(), states=False)
    tension = next(u for u in found.parts[0].uses if u.kind == "tension")
    span = LENGTH - 2 * REST / 3  # beyond the kern each post presses as a triangle at its inner edge
    weight = 1100.0 * LENGTH * HEIGHT * THICK * G
    moment = force * span / 4 + weight * (span / 4 - LENGTH / 8)
    sigma = 6 * moment / (THICK * HEIGHT**2)
    assert tension.stress / NOTCH[2] == pytest.approx(sigma, rel=0.04)
    assert abs(tension.place[0] - LENGTH / 2) < 0.05 and tension.case == "load_p"
    assert found.reached == pytest.approx(2e6 / tension.stress) and found.holds != (found.reached < 3.0)


def test_states_insertions_and_grips_are_load_cases():
    graph = PartsGraph.of(beam())
    found = assess(graph, StrengthOptions(insertion_force=20.0, grip_force=30.0))
    assert {"gravity", "insertion_beam", "grip_beam"} <= set(found.cases)
    alone = assess(graph, StrengthOptions(grip_force=3000.0), states=False)
    compression = next(u for u in alone.parts[0].uses if u.kind == "compression")
    assert compression.case == "grip_beam" and compression.share > 0.05
    assert found.joints[0].parts == ("a", "beam") and found.joints[0].use.kind == "bearing"


def test_a_load_case_that_does_not_balance_is_refused_by_name():
    with pytest.raises(InputError, match=r"'p' is not in equilibrium.*check.*design.*strength"):
        made = beam(1.0)
        up = replace(made.actions[0], force=np.array([0.0, 1e6]))
        assess(PartsGraph.of(replace(made, actions=(up,))), StrengthOptions())


def test_sections_of_a_box_have_its_areas_volumes_and_moments():
    shape = box((0.0, 0.0, 0.0), (2.0, 3.0, 4.0))
    cuts = cuts3d(shape, np.zeros((1, 3)), [])
    level = np.abs(cuts.normals[:, 2]) > 0.999
    assert level.sum() >= 3
    np.testing.assert_allclose(cuts.areas[level], 6.0)
    np.testing.assert_allclose(np.sort(np.linalg.eigvalsh(cuts.inertia[level]), axis=1), [[2.0, 4.5]] * level.sum())
    up = np.where(cuts.normals[level, 2] > 0, 4.0 - cuts.centres[level, 2], cuts.centres[level, 2])
    np.testing.assert_allclose(cuts.volumes[level], 6.0 * up, atol=0.8)


def test_a_chord_cuts_off_what_lies_on_its_side():
    shape = replace(rectangle(0.0, 0.0, 2.0, 1.0), thickness=0.5)
    cuts = cuts2d(shape, np.array([[0.0, 0.5], [2.0, 0.5]]))
    across = np.abs(cuts.normals[:, 0]) > 0.9999
    assert across.any()
    np.testing.assert_allclose(cuts.areas[across], 0.5)
    right = cuts.normals[across, 0] > 0
    beyond = np.where(right, 2.0 - cuts.centres[across, 0], cuts.centres[across, 0])
    np.testing.assert_allclose(cuts.volumes[across], 0.5 * beyond, atol=1e-12)
    np.testing.assert_array_equal(cuts.beyond[across, 1], right)


def test_weight_alone_grows_with_the_size_and_loads_bound_it_from_below():
    graph = PartsGraph.of(beam())
    found = assess(graph, StrengthOptions(), states=False)
    scale = largest_scale(graph, StrengthOptions(), found)
    assert scale == pytest.approx(found.reached / 3.0)
    larger = assess(graph, StrengthOptions(), states=False, scale=scale)
    assert larger.reached == pytest.approx(3.0, rel=1e-6)
    loaded = PartsGraph.of(beam(2.0))
    limit = largest_scale(loaded, StrengthOptions(), assess(loaded, StrengthOptions(), states=False))
    assert 0.0 < limit < scale
    assert assess(loaded, StrengthOptions(), states=False, scale=limit).reached == pytest.approx(3.0, rel=0.02)


def test_the_estimate_of_solids_agrees_with_that_of_the_same_plate():
    parts = [
        Part("a", box((0, 0, -0.2), (REST, THICK, 0)), fixed=True),
        Part("b", box((LENGTH - REST, 0, -0.2), (LENGTH, THICK, 0)), fixed=True),
        Part("beam", box((0, 0, 0), (LENGTH, THICK, HEIGHT)), 1100.0, material="plaster"),
    ]
    solid = assess(PartsGraph.of(Assembly("solid", tuple(parts), alpha_rad=None)), StrengthOptions(), states=False)
    flat = assess(PartsGraph.of(beam()), StrengthOptions(), states=False)
    assert solid.reached == pytest.approx(flat.reached * NOTCH[2] / NOTCH[3], rel=0.1)


def test_strength_comes_back_from_its_file_and_matches_the_schema_version(tmp_path):
    found = assess(PartsGraph.of(beam()), StrengthOptions(grip_force=5.0))
    path = write_strength(found, tmp_path / "strength.json", "beam")
    again = read_strength(path)
    assert strength_to_data(again, "beam") == strength_to_data(found, "beam")
    data = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**data, "version": 99}), encoding="utf-8")
    with pytest.raises(InputError, match="version 99"):
        read_strength(path)


def test_the_command_says_the_weakest_part_and_ends_with_its_verdict(tmp_path, capsys):
    (tmp_path / "shelf.json").write_text(
        json.dumps(
            {
                "format": "mocca-robot/assembly", "version": 1, "units": "m", "dimension": 2, "name": "shelf",
                "parts": [
                    {"name": "a", "fixed": True, "polygon": [[0, -1], [0.1, -1], [0.1, 0], [0, 0]]},
                    {"name": "b", "fixed": True, "polygon": [[1.9, -1], [2, -1], [2, 0], [1.9, 0]]},
                    {"name": "beam", "polygon": [[0, 0], [2, 0], [2, 0.05], [0, 0.05]]},
                ],
            }
        ),
        encoding="utf-8",
    )  # fmt: skip
    line = ["strength", str(tmp_path / "shelf.json"), "-o", str(tmp_path / "out"), "--estimate", "--scale", "--json"]
    assert main([*line, "--material", "plaster", "--safety", "1"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (
        said["weakest"] == "beam" and said["holds"] and said["largest_scale"] == pytest.approx(said["safety_reached"])
    )
    assert main([*line, "--material", "plaster", "--safety", "50"]) == 1
    assert not json.loads(capsys.readouterr().out)["holds"]
    assert "Will it break?" in (tmp_path / "out" / "strength.html").read_text(encoding="utf-8")
    assert main([*line, "--material", "plasterr"]) == 2
    assert "plaster" in json.loads(capsys.readouterr().out)["error"]
