"""Verdicts from geometry: the rays that suffice give the same verdicts, and a barred way in is not the only one."""

import numpy as np
import pytest
from physics_models import box_mesh, jointed, stack

from mocca_robot.assembly import Assembly, Part
from mocca_robot.joints.joint import spanning_rays
from mocca_robot.motion.insertion import insertion_verdicts
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics import cases
from mocca_robot.statics.cases import case_at, critical_tilt, solve_case


def forget() -> None:
    spanning_rays.cache_clear()
    cases._system.cache_clear()
    cases._whole_system.cache_clear()


def test_rays_that_span_give_the_same_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    assembly, contacts = jointed(stack(4), 0.3)
    assert spanning_rays(contacts).all()
    angles = (0.0, 0.2, 0.4, 0.6)
    graph = PartsGraph.of(assembly, contacts)
    all_rays = [solve_case(graph, case_at(assembly, a, 0.0)) for a in angles]
    tilt = critical_tilt(graph, 0.0)
    monkeypatch.setattr("mocca_robot.joints.joint.MANY", 0)
    monkeypatch.setattr("mocca_robot.joints.joint.CROWDED", 0)
    forget()
    assert 0 < spanning_rays(contacts).sum() < len(spanning_rays(contacts))
    for before, angle in zip(all_rays, angles, strict=True):
        after = solve_case(graph, case_at(assembly, angle, 0.0))
        assert after.result.status is before.result.status
        assert after.result.infeasibility == pytest.approx(before.result.infeasibility, abs=1e-12)
        assert not after.result.forces[~spanning_rays(contacts)].any()
    assert critical_tilt(graph, 0.0) == pytest.approx(tilt, abs=1e-5)
    forget()


def test_a_barred_way_in_is_not_the_only_one() -> None:
    """A beam that touches nothing hangs over the middle of the block: it goes in beside it."""
    floor, block = box_mesh((0, 0, 0), (3, 3, 1)), box_mesh((1, 1, 1), (2, 2, 1.5))
    beam = box_mesh((1.4, 0, 6), (1.6, 3, 6.2))
    parts = (Part("floor", floor, fixed=True), Part("beam", beam, fixed=True), Part("block", block))
    assembly = Assembly("beneath a beam", parts, alpha_rad=float(np.deg2rad(5)))
    graph = PartsGraph.of(assembly)
    (found,) = insertion_verdicts(graph)
    assert found.assemblable and not found.blockers and found.alpha_rad >= np.deg2rad(5)
    (barred,) = insertion_verdicts(PartsGraph.of(assembly, graph.contacts, {"block": np.array([0.0, 0.0, -1.0])}))
    assert barred.collides and barred.blockers == ("beam",)
