"""Verdicts in words: what counts as a contradiction between physics and statics, and what does not."""

from typing import Any

import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Equilibrium, Goal, Interlocking, Part, Polygon, SupportFree
from mocca_robot.cli.closing_lines import physics_words
from mocca_robot.cli.physics_evidence import explained, simulation_findings

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def assembly(*goals: Goal) -> Assembly:
    shapes = [Polygon(SQUARE + np.array([0.0, height])) for height in range(3)]
    parts = tuple(Part(name, shape, fixed=name == "a") for name, shape in zip("abc", shapes))
    return Assembly("x", parts, goals or (Equilibrium(),))


def state(placed: str, stable: bool | None, statics: bool | None) -> dict[str, Any]:
    return {
        "placed": placed,
        "stable": stable,
        "statics_stable": statics,
        "agrees": stable is not None and stable == statics,
        "moved": [] if stable else [placed],
        "reason": "the clock stopped",
    }


def tilt(critical: float, statics: float, friction: float, failed: tuple[float, ...] = ()) -> dict[str, Any]:
    return {
        "azimuth_deg": 0.0,
        "critical_deg": critical,
        "statics_deg": statics,
        "friction": friction,
        "runs_without_verdict_deg": list(failed),
    }


def kinds(simulation: dict[str, Any], *goals: Goal) -> list[str]:
    return [f.kind for f in simulation_findings(assembly(*goals), simulation)]


def test_falling_states_count_only_where_they_are_asked_for() -> None:
    states = {"states": [state("b", False, False), state("c", True, True)]}
    assert kinds(states) == []
    assert kinds(states, SupportFree()) == ["falls"]
    end = {"states": [state("b", True, True), state("c", False, False)]}
    assert kinds(end) == ["falls"]
    assert kinds(end, Interlocking("c")) == []


def test_every_disagreement_counts_asked_for_or_not() -> None:
    states = {"states": [state("b", False, True), state("c", True, True)]}
    assert kinds(states) == ["disagreement"]
    assert kinds({"states": [state("b", None, True), state("c", True, True)]}) == ["inaccurate"]


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize(
    ("critical", "statics", "found"),
    [(2.4, 2.5, []), (1.5, 2.5, ["disagreement"]), (12.0, 10.0, ["disagreement"])],
)
def test_tilts_apart_are_a_disagreement_with_and_without_friction(
    critical: float, statics: float, friction: float, found: list[str]
) -> None:
    assert kinds({"tilt": [tilt(critical, statics, friction)]}) == found


def test_a_disagreement_is_told_with_its_cause() -> None:
    early = {**tilt(10.0, 12.0, 0.0), "cause": "none found (fell with a step of 5 µs)"}
    (finding,) = simulation_findings(assembly(), {"tilt": [early]})
    assert finding.text.endswith("12.00° by statics; cause: none found (fell with a step of 5 µs).")
    fallen = {**state("b", False, True), "cause": "soft contacts"}
    (finding,) = simulation_findings(assembly(), {"states": [fallen, state("c", True, True)]})
    assert "falls in MuJoCo and stands by statics; cause: soft contacts." in finding.text


def test_only_tilts_below_the_bound_that_statics_is_with_friction_hold_nothing_against_a_design() -> None:
    shown = {**tilt(10.0, 12.0, 0.3), "cause": "friction not made by the fall: fell with a step of 5 µs"}
    (note,) = explained(assembly(), {"tilt": [shown]})
    assert simulation_findings(assembly(), {"tilt": [shown]}) == [] and "12.00° by statics; cause: friction" in note
    for other in ({"friction": 0.0}, {"critical_deg": 14.0}, {"cause": ""}, {"runs_without_verdict_deg": [10.2]}):
        entry = {**shown, **other}
        assert [f.kind for f in simulation_findings(assembly(), {"tilt": [entry]})] == ["disagreement"]
        assert explained(assembly(), {"tilt": [entry]}) == []


def test_runs_without_a_verdict_are_never_hidden() -> None:
    assert kinds({"tilt": [tilt(10.0, 12.0, 0.3, failed=(10.5,))]}) == ["disagreement"]


def test_jams_inside_and_passages_outside_the_cone() -> None:
    trials = [{"kind": "rim", "succeeded": False, "reason": "penetrated by 1 mm"}]
    entry = {"part": "b", "inside": {"trials": 1, "succeeded": 0}, "outside": {"trials": 2, "succeeded": 1}}
    found = simulation_findings(assembly(), {"insertion": [{**entry, "trials": trials}]})
    assert [f.kind for f in found] == ["jams", "disagreement"]
    assert "penetrated by 1 mm" in found[0].text and all(f.parts == ("b",) for f in found)


def test_engines_are_no_closer_than_physics_is_fine() -> None:
    told = {"engine": "mujoco", "tilt": [{**tilt(12.5, 12.5, 0.0), "within_deg": 0.05}]}
    assert "statics at most 0.05° apart" in physics_words(told)


def test_every_friction_has_its_tilt() -> None:
    told = {"tilt": [tilt(12.5, 12.5, 0.0), tilt(30.0, 30.0, 0.3), tilt(21.0, 21.5, 0.3)]}
    assert "(statics at most 0.00° apart), 21.00° with friction 0.3 (statics at most 0.50°" in physics_words(told)
