"""Statics and MuJoCo give the same verdicts just below and just above the critical tilt of random assemblies."""

import pytest

from benchmarks.agreement import Comparison, Probe, random_case

CASES = [(kind, seed) for kind in ("stack", "wall", "arch", "voronoi") for seed in (0, 1)]
CASES += [("wall", 5), ("notched", 1), ("blocks", 1), ("solid_notched", 0)]


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_verdicts_agree_away_from_the_critical_tilt(kind: str, seed: int) -> None:
    found = random_case(kind, seed)
    assert isinstance(found, Comparison)
    assert found.verdict in ("agree", "bounded"), found.words()


def test_only_friction_excuses_falling_early_and_nothing_excuses_holding_longer() -> None:
    early = Probe(0.1, "equilibrium", "fell", "")
    late = Probe(0.2, "not_in_equilibrium", "stands", "")
    failed = Probe(0.1, "equilibrium", "failed", "")
    assert Comparison(0.15, 0.0, (early,)).verdict == "DISAGREE"
    assert Comparison(0.15, 0.4, (early,)).verdict == "bounded"
    assert Comparison(0.15, 0.4, (late,)).verdict == "DISAGREE"
    assert Comparison(0.15, 0.4, (failed,)).verdict == "DISAGREE"
