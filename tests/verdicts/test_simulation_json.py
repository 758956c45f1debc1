"""simulation.json is a codec: what is written is read again, and what cannot be used is refused with its place."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocca_robot.assembly import Assembly, Equilibrium, Part, Polygon
from mocca_robot.errors import InputError
from mocca_robot.statics.solution import Status
from mocca_robot.verdicts.physics import (
    InsertionTrial,
    PartInsertion,
    Robustness,
    Simulation,
    StateVerdict,
    TiltVerdict,
    Verdict,
)
from mocca_robot.verdicts.simulation_json import (
    read_simulation,
    simulation_from_data,
    simulation_to_data,
    write_simulation,
)

SQUARE = Polygon(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]))
ASSEMBLY = Assembly("x", (Part("a", SQUARE, fixed=True),), (Equilibrium(),))

names = st.text(st.characters(whitelist_categories=("L", "N", "P")), min_size=1, max_size=8)
words = st.text(max_size=20)
sizes = st.floats(0.0, 1e6)
numbers = st.floats(-1e6, 1e6)
angles = st.floats(0.0, np.pi / 2).filter(lambda a: float(np.deg2rad(np.rad2deg(a))) == a)
"""A file holds degrees: of other angles the way there and back moves the last bit."""
engines = st.sampled_from(["", "mujoco 3.17.0", "springs 1"])
vectors = st.tuples(numbers, numbers)


def tuples(of: st.SearchStrategy[Any], most: int = 3) -> st.SearchStrategy[Any]:
    return st.lists(of, max_size=most).map(tuple)


states = st.builds(
    StateVerdict,
    placed=names,
    verdict=st.sampled_from(Verdict),
    statics=st.sampled_from([*Status, None]),
    friction=st.none() | sizes,
    reason=words,
    moved=tuples(names),
    statics_moved=tuples(names),
    max_displacement=sizes,
    max_share=sizes,
    final_speed=sizes,
    duration=sizes,
    times=tuples(sizes),
    poses=tuples(tuples(st.tuples(numbers, numbers, numbers))),
    parts=tuples(names),
    cause=words,
    engine=engines,
)
tilts = st.builds(
    TiltVerdict,
    azimuth_rad=angles,
    critical_rad=angles,
    statics_rad=angles,
    friction=sizes,
    moved=tuples(names),
    failed=tuples(angles),
    within_rad=angles,
    cause=words,
    engine=engines,
)
trials = st.builds(
    InsertionTrial,
    part=names,
    kind=st.sampled_from(["axis", "interior", "rim", "outside"]),
    direction=vectors,
    clearance=sizes,
    error=sizes,
    below=st.sampled_from(["held", "free"]),
    succeeded=st.booleans(),
    reason=words,
    peak_force=sizes,
    allowed_force=st.floats(0.1, 1e6),
    peak_penetration=sizes,
    tracking_error=sizes,
    moved_below=tuples(names),
    steps=st.integers(0, 10**9),
)
insertions = st.builds(
    lambda **given: PartInsertion(
        **{**given, "trials": tuple(replace(t, part=given["part"]) for t in given["trials"])}
    ),
    part=names,
    axis=vectors,
    realised_rad=angles.map(lambda a: -a),
    tried_rad=angles,
    friction=st.none() | sizes,
    trials=tuples(trials),
)
robustness = st.builds(
    Robustness,
    trials=st.integers(0, 100),
    succeeded=st.integers(0, 100),
    low=sizes,
    high=sizes,
    confidence=sizes,
    failures=st.dictionaries(words, st.integers(0, 100), max_size=3),
    distributions=st.dictionaries(words, st.booleans() | numbers | vectors, max_size=3),
)
simulations = st.builds(
    Simulation,
    name=words,
    engine=words,
    states=tuples(states),
    tilt=tuples(tilts),
    insertion=tuples(insertions),
    robust=st.none() | robustness,
    seconds=st.dictionaries(words, sizes, max_size=3).map(lambda d: {**d, "total": 1.5}),
    notes=tuples(words),
    interrupted=st.booleans(),
)


@given(simulations)
def test_what_is_written_is_read_again(simulation: Simulation) -> None:
    data = json.loads(json.dumps(simulation_to_data(simulation, ASSEMBLY), allow_nan=False))
    assert simulation_from_data(data, "a.json") == simulation


OLD: dict[str, Any] = {
    "format": "mocca-robot/simulation",
    "version": 1,
    "name": "x",
    "engine": "mujoco 3.10.0",
    "seconds": 2.0,
    "seconds_by_stage": {"states": 1.0, "total": 2.0},
    "interrupted": False,
    "disagreements": ["state after 'b': MuJoCo fell, statics equilibrium"],
    "notes": ["mine"],
    "states": [
        {
            "placed": "b",
            "stable": False,
            "statics_stable": True,
            "moved": ["b"],
            "max_displacement_m": 0.1,
            "agrees": False,
            "reason": "'b' moved by 100 mm",
            "statics_moved": [],
            "max_displacement_share": 0.5,
            "final_speed_m_s": 1.0,
            "simulated_s": 0.4,
            "motion": {"parts": ["b"], "times_s": [0.0], "poses": [[[0.0, 0.0, 0.0]]]},
        }
    ],
    "tilt": [
        {
            "azimuth_deg": 0.0,
            "critical_deg": 10.0,
            "statics_deg": 12.0,
            "friction": 0.3,
            "moved": ["b"],
            "runs_without_verdict_deg": [10.5],
        }
    ],
    "insertion": [],
}


def test_a_file_of_the_first_version_is_read() -> None:
    found = simulation_from_data(OLD, "old.json")
    (state,), (tilt,) = found.states, found.tilt
    assert (state.verdict, state.statics, state.friction, state.cause) == (Verdict.FELL, Status.EQUILIBRIUM, None, "")
    assert state.poses == (((0.0, 0.0, 0.0),),) and found.seconds["total"] == 2.0
    assert tilt.within_rad == 0.0 and np.rad2deg([tilt.critical_rad, *tilt.failed]) == pytest.approx([10.0, 10.5])
    assert found.engine_of(tilt) == "mujoco 3.10.0" and found.notes == ("mine",)


@pytest.mark.parametrize(
    ("broken", "told"),
    [
        ({"states": {}}, r"a.json: states must be a list"),
        ({"states": [{"stable": True}]}, r"states\[0\]: placed must be a name"),
        ({"states": [{"placed": "b", "stable": "yes"}]}, r"states\[0\]: stable must be true or false"),
        ({"tilt": [{**OLD["tilt"][0], "critical_deg": "ten"}]}, r"tilt\[0\]: critical_deg must be a number, not 'ten'"),
        ({"tilt": [{"azimuth_deg": 0.0}]}, r"tilt\[0\]: critical_deg must be a number, not null"),
        ({"notes": [1]}, r"notes\[0\] must be a text"),
        ({"version": 2}, r"version 2"),
    ],
)
def test_what_cannot_be_used_is_refused_with_its_place(broken: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        simulation_from_data({**OLD, **broken}, "a.json")


def test_files_that_are_none_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text('{"format": "something"}')
    with pytest.raises(InputError, match='it must be "mocca-robot/simulation"'):
        read_simulation(path)
    path.write_text("{")
    with pytest.raises(InputError, match=r"x\.json"):
        read_simulation(path)
    whole = Simulation(name="x", engine="mujoco 3", states=simulation_from_data(OLD, "old.json").states)
    assert read_simulation(write_simulation(whole, path, ASSEMBLY)) == replace(whole, seconds={"total": 0.0})
