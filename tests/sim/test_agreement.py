"""Statics and physics give the same verdicts just below and just above the critical tilt of random assemblies."""

import pytest
from physics_models import tongue

from benchmarks.agreement import Comparison, Probe, random_case
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.solution import Status
from mocca_robot.verdicts.physics import Verdict
from sim.disagreement import cause
from sim.shapes.contact_model import contact_model
from sim.stability import StabilityLimits, judged
from sim.tilt import tilt_scene

CASES = [(kind, seed) for kind in ("stack", "wall", "arch", "voronoi") for seed in (0, 1)]
CASES += [("notched", 1), ("notched", 2), ("ridged", 0), ("ridged", 2), ("blocks", 1), ("peaks", 0), ("peaks", 2)]
CASES += [("wall", 3), ("arch", 3), ("solid_arch", 1)]


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_verdicts_agree_away_from_the_critical_tilt(kind: str, seed: int) -> None:
    found = random_case(kind, seed)
    assert isinstance(found, Comparison)
    assert found.verdict == "agree", found.words()


def test_a_verdict_agrees_only_where_both_decide_alike() -> None:
    holds, slides = Status.EQUILIBRIUM, Status.NOT_IN_EQUILIBRIUM
    below, above = Probe(0.1, holds, Verdict.STANDS, ""), Probe(0.2, slides, Verdict.FELL, "")
    assert Comparison(0.15, 0.4, (below, above)).verdict == "agree"
    wrong = [(holds, Verdict.FELL), (slides, Verdict.STANDS), (holds, Verdict.FAILED)]
    for statics, physics in [*wrong, (Status.INACCURATE, Verdict.FELL)]:
        assert Comparison(0.15, 0.4, (below, Probe(0.2, statics, physics, ""))).verdict == "DISAGREE"
    assert Comparison(0.0, 0.4, ()).verdict == "near"


def test_contacts_that_are_too_soft_are_found_to_be_the_cause() -> None:
    """A tongue that stands with fine steps falls with the coarse one alone."""
    assembly = tongue(0.004)
    scene = tilt_scene(assembly, contact_model(assembly, PartsGraph.of(assembly).contacts))
    soft = judged(scene, StabilityLimits(finer=()))
    assert soft.verdict is Verdict.FELL
    assert cause(scene, soft).startswith("soft contacts: stands")


def test_with_friction_physics_lifts_nothing() -> None:
    """A stack in a groove whose walls could pinch the tongue as hard as they like falls all the same."""
    found = random_case("notched", 11)
    assert isinstance(found, Comparison)
    assert "critical tilt 41." in found.probes[0].reason
