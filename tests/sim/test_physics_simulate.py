"""The whole simulation: it answers what was asked, agrees with statics, resumes, and says what it does not know."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from physics_models import WIDTH, box_stack_3d, jointed, stack
from processes import posix_only

from mocca_robot.errors import InputError
from mocca_robot.runtime.content_hash import content_hash
from mocca_robot.runtime.executors import executor
from mocca_robot.verdicts.agreement import agree
from mocca_robot.verdicts.simulation_json import simulation_to_data
from sim.motion import Abandoned, abandoned
from sim.questions import Questions
from sim.robust import RobustOptions, wilson
from sim.shapes.contact_model import contact_model
from sim.simulate import simulate
from sim.stability import free_scene, stability
from sim.trial_store import Trial, TrialStore, run_trials

ASK = Questions(directions=3, clearances=(0.0, 3e-4), threads=2)


@pytest.fixture(scope="module")
def simulated():
    assembly, _ = jointed(stack(2))
    seen = []
    found = simulate(assembly, None, ASK, lambda *step: seen.append(step))
    return assembly, found, seen


def test_physics_and_statics_agree_on_a_good_design(simulated):
    _, found, _ = simulated
    assert not found.interrupted
    assert all(agree(s.verdict, s.statics) for s in found.states)
    assert [t.friction for t in found.tilt] == [0.0, 0.0, 0.3, 0.3]
    assert all(t.succeeded == t.inside for t in found.trials), [t.reason for t in found.trials]
    assert all(abs(t.critical_rad - t.statics_rad) < np.deg2rad(0.5) for t in found.tilt if t.friction == 0.0)


def test_progress_counts_up_to_the_end_of_each_stage(simulated):
    _, _, seen = simulated
    assert [s[1:] for s in seen if s[0].startswith("state")] == [(1, 2), (2, 2)]
    assert seen[-1][1] == seen[-1][2]


def test_stages_that_run_side_by_side_find_out_what_each_does_alone(simulated):
    assembly, found, seen = simulated
    assert {s[0].split()[0] for s in seen if s[2] == seen[-1][2]} == {"tilt", "insert"}
    assert simulate(assembly, None, replace(ASK, stages=("tilt",))).tilt == found.tilt
    # States tell whether what is below a part stands, and so whether it is tried free.
    alone = simulate(assembly, None, replace(ASK, stages=("states", "insertion")))
    assert len(alone.trials) > 0 and alone.insertion == found.insertion


def test_the_file_is_the_contract_and_plain_json(simulated):
    assembly, found, _ = simulated
    data = simulation_to_data(found, assembly)
    assert data["format"] == "mocca-robot/simulation" and data["version"] == 1
    assert data["engine"].startswith("mujoco ")
    assert {"placed", "stable", "statics_stable", "moved", "max_displacement_m"} <= data["states"][0].keys()
    assert {"azimuth_deg", "critical_deg", "statics_deg", "friction"} <= data["tilt"][0].keys()
    entry = data["insertion"][0]
    assert entry["inside"]["trials"] == entry["inside"]["succeeded"] > 0
    assert entry["outside"]["trials"] > 0 and entry["outside"]["succeeded"] == 0
    again = json.loads(json.dumps(data))
    assert again["tilt"] == data["tilt"] and again["insertion"] == data["insertion"]


def test_finished_trials_are_not_run_again(simulated, tmp_path):
    assembly, found, _ = simulated
    file = tmp_path / "trials.jsonl"
    ask = replace(ASK, stages=("states", "tilt"))
    first = simulate(assembly, None, ask, store=TrialStore(file))
    lines = file.read_text().splitlines()
    again = simulate(assembly, None, ask, store=TrialStore(file))
    assert file.read_text().splitlines() == lines
    assert (again.states, again.tilt) == (first.states, first.tilt) == (found.states, found.tilt)
    file.write_text("\n".join(lines[:-1]) + "\n" + lines[-1][: len(lines[-1]) // 2])
    resumed = simulate(assembly, None, ask, store=TrialStore(file))
    assert resumed.tilt == first.tilt


def test_an_interruption_keeps_what_is_finished(tmp_path):
    assembly, _ = jointed(stack(3))
    store = TrialStore(tmp_path / "trials.jsonl")

    def stop(label: str, done: int, total: int) -> None:
        raise KeyboardInterrupt

    found = simulate(assembly, None, replace(ASK, threads=1), stop, store)
    assert found.interrupted and not found.tilt and not found.insertion
    assert 0 < len(store) == len(found.states)
    assert simulation_to_data(found, assembly)["interrupted"]


def test_what_takes_too_long_after_an_interruption_is_abandoned(monkeypatch):
    monkeypatch.setattr("sim.trial_store.GRACE_S", 0.05)
    begun = threading.Event()

    def endless() -> dict[str, object]:
        begun.set()
        assert abandoned.wait(60.0), "nobody said that it was over"
        raise Abandoned("over")

    def stop(label: str, done: int, total: int) -> None:
        assert begun.wait(60.0)
        raise KeyboardInterrupt

    rows = run_trials([Trial("quick", ("q",), dict), Trial("endless", ("e",), endless)], TrialStore(), 2, stop)
    assert rows == [{}, None]


def wait_for_ever(file: Path) -> dict[str, object]:
    """A trial that says which process it runs in, and never ends."""
    file.write_text(str(os.getpid()), encoding="utf-8")
    time.sleep(1e6)
    return {}


@posix_only
def test_after_an_interruption_no_process_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr("sim.trial_store.GRACE_S", 0.05)
    begun = tmp_path / "begun"

    def stop(label: str, done: int, total: int) -> None:
        while not (begun.exists() and begun.read_text()):
            time.sleep(0.02)
        raise KeyboardInterrupt

    trials = [Trial("quick", ("q",), dict), Trial("endless", ("e",), partial(wait_for_ever, begun))]
    with executor(2) as processes:
        assert run_trials(trials, TrialStore(), 2, stop, processes) == [{}, None]
    with pytest.raises(ProcessLookupError):
        os.kill(int(begun.read_text()), 0)


def test_a_run_that_is_abandoned_says_nothing(monkeypatch):
    assembly, contacts = jointed(stack(2))
    abandoned.set()
    try:
        with pytest.raises(Abandoned):
            stability(free_scene(assembly, contact_model(assembly, contacts)))
    finally:
        abandoned.clear()


def test_large_structures_are_tilted_with_friction_only_when_asked(monkeypatch):
    assembly = box_stack_3d(3)[0]
    monkeypatch.setattr(sys.modules[simulate.__module__], "MOST_POINTS", 1)
    monkeypatch.setattr("sim.coulomb.judge.MOST_POINTS", 1)
    ask = Questions(stages=("tilt",), azimuths=1)
    found = simulate(assembly, None, ask)
    assert {t.friction for t in found.tilt} == {0.0}
    assert any("friction 0.3 is left out" in note for note in found.notes)
    asked = simulate(assembly, None, replace(ask, friction=0.3))
    assert {t.friction for t in asked.tilt} == {0.0, 0.3} and not asked.notes
    for tilt in asked.tilt:
        assert abs(tilt.critical_rad - tilt.statics_rad) < np.deg2rad(1.5)


def test_an_error_in_a_trial_is_raised_and_the_others_are_kept():
    store = TrialStore()

    def fail() -> dict[str, object]:
        raise InputError("part 'x' has no mass")

    trials = [Trial("good", ("good",), dict), Trial("bad", ("bad",), fail)]
    with pytest.raises(InputError, match="part 'x'"):
        run_trials(trials, store, threads=1)
    assert store.get(content_hash(("good",))) == {}


def test_an_unstable_design_shows_where_it_falls():
    assembly, _ = jointed(stack(3, 0.45 * WIDTH), 0.1)
    found = simulate(assembly, None, replace(ASK, stages=("states", "insertion"), directions=1))
    assert found.needs_support
    assert all(agree(s.verdict, s.statics) for s in found.states)
    followers = {f"b{int(name[1:]) + 1}" for name in found.needs_support} & {"b1", "b2"}
    assert {
        name for name in ("b1", "b2") if any(name in n and "without support" in n for n in found.notes)
    } == followers


def test_overlapping_parts_and_gaps_are_named():
    assembly = stack(2)
    shapes = [p.shape for p in assembly.parts]
    sunk = replace(shapes[2], exterior=shapes[2].exterior - np.array([0.0, 0.1 * WIDTH]))
    with pytest.raises(InputError, match="'b0' and 'b1' overlap"):
        simulate(assembly.with_shapes([*shapes[:2], sunk]))
    raised = replace(shapes[2], exterior=shapes[2].exterior + np.array([0.0, 2e-4]))
    with pytest.raises(InputError, match="'b1' floats free"):
        simulate(assembly.with_shapes([*shapes[:2], raised]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stages": ("tlt",)}, "did you mean 'tilt'"),
        ({"azimuths": 0}, "azimuths = 0"),
        ({"friction": -0.1}, "-0.1"),
        ({"clearances": (float("nan"),)}, "nan"),
    ],
)
def test_questions_that_make_no_sense_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        replace(Questions(), **change)


def test_insertion_directions_for_unknown_parts_are_refused():
    with pytest.raises(InputError, match="did you mean 'b1'"):
        simulate(stack(2), {"b11": np.array([0.0, -1.0])})


def test_wilsons_interval_is_honest_at_the_ends():
    low, high = wilson(20, 20, 0.95)
    assert high == 1.0 and low == pytest.approx(0.8389, abs=1e-4)
    low, high = wilson(5, 10, 0.95)
    assert (low, high) == (pytest.approx(0.2366, abs=1e-4), pytest.approx(0.7634, abs=1e-4))


def test_robustness_is_the_same_for_the_same_seed():
    assembly, _ = jointed(stack(2))
    ask = Questions(stages=("robust",), robust=RobustOptions(trials=4), seed=3, threads=2)
    first, second = simulate(assembly, None, ask).robust, simulate(assembly, None, ask).robust
    assert first == second and first is not None
    assert first.trials == 4 and first.low <= first.rate <= first.high
    with pytest.raises(InputError, match="0 robustness trials"):
        RobustOptions(trials=0)
