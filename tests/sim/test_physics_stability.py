"""Closed forms that physics must give, agreement with statics, and runs that must not be believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from physics_models import WIDTH, box_stack_3d, jointed, rectangle, semicircle, stack, tongue

from mocca_robot.assembly import Assembly, Part
from mocca_robot.contacts.find import find_contacts
from mocca_robot.errors import InputError
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import case_at, critical_tilt, solve_case
from mocca_robot.statics.loads import state_cases, tilted_gravity
from mocca_robot.statics.solution import Status
from mocca_robot.verdicts.agreement import agree
from mocca_robot.verdicts.physics import Verdict
from sim.coulomb import verdicts
from sim.coulomb.judge import rubbing
from sim.motion import run
from sim.scene import compile_scene, with_gravity
from sim.settings import settings_for
from sim.shapes.contact_model import contact_model, facets, pieces
from sim.stability import StabilityLimits, free_scene, judged, stability
from sim.tilt import RESOLUTION, azimuths, physical_tilt, tilt_scene


def let_go(assembly, angle=0.0, friction=0.0, model=None):
    model = model or pieces(assembly)
    gravity = tilted_gravity(assembly.gravity, angle)
    return stability(free_scene(assembly, model, gravity=gravity, friction=friction))


@pytest.mark.parametrize("friction", [0.2, 0.5])
@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("kind", ["pieces", "facets"])
def test_a_block_slides_down_a_slope_from_atan_mu(friction, side, kind):
    block = stack(1)
    graph = PartsGraph.of(block)
    contacts = graph.contacts
    model = pieces(block) if kind == "pieces" else facets(contacts)
    angle = np.arctan(friction) + side * np.deg2rad(0.5)
    assert let_go(block, angle, friction, model).stands == (side < 0)
    assert solve_case(graph, case_at(block, angle, 0.0), friction).result.stands == (side < 0)


@pytest.mark.parametrize("blocks", [1, 3, 10])
def test_a_stack_tips_over_at_atan_width_over_height(blocks):
    assembly = stack(blocks)
    graph = PartsGraph.of(assembly)
    found = verdicts.tilt_verdict(rubbing(graph, 2.0), 0.0)
    assert found.critical_rad == pytest.approx(np.arctan(1 / blocks), abs=np.deg2rad(0.5))
    assert not found.failed


@pytest.mark.parametrize(("thickness", "stands"), [(0.09, False), (0.105, False), (0.11, True), (0.12, True)])
def test_an_arch_stands_from_its_least_thickness(thickness, stands):
    """27 voussoirs over a half circle of radius 1, friction 0.55: the limit is about 0.1075, in both engines."""
    assembly = semicircle(thickness)
    graph = PartsGraph.of(assembly)
    contacts = graph.contacts
    assert solve_case(graph, case_at(assembly, 0.0, 0.0), 0.55).result.stands == stands
    assert let_go(assembly, 0.0, 0.55, contact_model(assembly, contacts, 0.55)).stands == stands


@pytest.mark.parametrize(("share", "stands"), [(0.05, True), (0.09, True), (0.11, False), (0.2, False)])
def test_shifted_cubes_stand_up_to_their_overhang_limit(share, stands):
    """Ten cubes, each shifted by a share of its width: the limit is 0.10, in both engines."""
    assembly = stack(10, share * WIDTH)
    graph = PartsGraph.of(assembly)
    contacts = graph.contacts
    assert solve_case(graph, case_at(assembly, 0.0, 0.0), 0.5).result.stands == stands
    found = let_go(assembly, 0.0, 0.5, facets(contacts))
    assert found.stands == stands
    assert bool(found.moved) == (not stands)


@pytest.mark.parametrize(("height", "lean"), [(0.2, 0.0), (-0.2, 0.2), (0.3, -0.1)])
@pytest.mark.parametrize("azimuth", [0.0, np.pi])
def test_curved_joints_let_go_where_statics_says(height, lean, azimuth):
    assembly, contacts = jointed(stack(3), height, lean)
    graph = PartsGraph.of(assembly, contacts)
    for model in (pieces(assembly, contacts), facets(contacts)):
        found = physical_tilt(tilt_scene(assembly, model), graph, azimuth)
        assert found.statics_rad == critical_tilt(graph, azimuth)
        assert abs(found.critical_rad - found.statics_rad) < np.deg2rad(0.5)
        assert found.moved and not found.failed


def test_solids_tip_over_where_statics_says():
    assembly, contacts = box_stack_3d(3)
    graph = PartsGraph.of(assembly, contacts)
    rubs = rubbing(graph, 2.0)
    for azimuth in (0.0, np.pi / 4, np.pi):
        found = verdicts.tilt_verdict(rubs, azimuth)
        assert abs(found.critical_rad - found.statics_rad) < np.deg2rad(1.0)
    assert found.critical_rad == pytest.approx(np.arctan(1 / 3), abs=np.deg2rad(0.5))


@pytest.mark.parametrize("side", [-1, 1])
def test_a_solid_slides_from_atan_mu(side):
    assembly, contacts = box_stack_3d(1)
    angle = np.arctan(0.3) + side * np.deg2rad(0.5)
    assert let_go(assembly, angle, 0.3, facets(contacts)).stands == (side < 0)


def test_every_state_agrees_with_statics_also_where_it_falls():
    """The fourth block hangs over too far; a fifth on top cannot save it."""
    assembly = stack(5, 0.3 * WIDTH)
    graph = PartsGraph.of(assembly)
    results = [verdicts.state_verdict(rubbing(graph, 0.5), case) for case in state_cases(graph)]
    assert [r.placed for r in results] == [p.name for p in assembly.parts if not p.fixed]
    assert all(agree(r.verdict, r.statics) for r in results)
    assert results[0].stands and not results[-1].stands
    assert results[-1].moved and results[-1].times and len(results[-1].poses) == len(results[-1].times)


def test_the_verdict_does_not_depend_on_where_the_assembly_is_drawn():
    assembly = stack(3)
    moved = assembly.with_shapes(
        [replace(p.shape, exterior=p.shape.exterior + np.array([3.0, -2.0])) for p in assembly.parts]
    )
    a, b = let_go(assembly, 0.3, 2.0), let_go(moved, 0.3, 2.0)
    assert a.verdict == b.verdict
    assert a.max_share == pytest.approx(b.max_share, abs=1e-4)


def test_a_run_whose_solver_gives_up_is_failed_not_judged():
    assembly, _ = jointed(stack(3))
    scene = free_scene(assembly, pieces(assembly))
    strangled = replace(scene, settings=replace(scene.settings, iterations=1, tolerance=0.0))
    found = judged(compile_scene(strangled))
    assert found.verdict is Verdict.FAILED
    assert "iterations" in found.reason


def test_parts_that_overlap_before_anything_moves_are_named():
    assembly = stack(2)
    parts = [p.shape for p in assembly.parts]
    parts[2] = replace(parts[2], exterior=parts[2].exterior - np.array([0.0, 0.2 * WIDTH]))
    found = let_go(assembly.with_shapes(parts))
    assert found.verdict is Verdict.FAILED
    assert "'b0' and 'b1' overlap by 10 mm" in found.reason


def test_a_run_that_gains_energy_is_failed():
    """Gravity that doubles while the run goes on: energy from nowhere."""
    scene = free_scene(stack(2), pieces(stack(2)))
    compiled = with_gravity(compile_scene(scene), scene.gravity)

    def doubled(time, displacement, speed):
        compiled.model.opt.gravity[2] = -2 * 9.81
        return False

    motion = run(compiled, 1.0, doubled)
    assert motion.failure == "energy grew without cause" and motion.times[-1] < 0.9
    assert run(compile_scene(scene), 1.0).failure is None


def test_contacts_under_many_times_the_weight_still_hold():
    """Walls of 4 mm hold an arm of 200 mm by a couple of forces 25 times its weight, and by nothing else."""
    assembly = tongue(0.004)
    graph = PartsGraph.of(assembly)
    contacts = graph.contacts
    forces = solve_case(graph, case_at(assembly, 0.0, 0.0)).result
    assert forces.status is Status.EQUILIBRIUM
    assert forces.forces.max() > 20.0 * assembly.parts[1].mass * 9.81
    scene = free_scene(assembly, pieces(assembly, contacts))
    assert stability(scene).stands
    soft = stability(scene, StabilityLimits(finer=()))
    assert not soft.stands, "the coarse step alone decides already: nothing is shown here"
    assert stability(scene).timestep < soft.timestep


def test_the_tilt_search_goes_on_above_falls_that_finer_steps_do_not_confirm():
    """Without them the tongue falls upright. It stands, but any tilt away from its wall lets it slide out."""
    assembly = tongue(0.004)
    graph = PartsGraph.of(assembly)
    contacts = graph.contacts
    compiled = tilt_scene(assembly, pieces(assembly, contacts))
    assert physical_tilt(compiled, graph, 0.0, limits=StabilityLimits(finer=())).critical_rad == 0.0
    assert 0.0 < physical_tilt(compiled, graph, 0.0).critical_rad < RESOLUTION


def test_a_fall_is_confirmed_with_finer_steps():
    assembly = stack(1)
    found = let_go(assembly, 0.3)
    assert found.verdict is Verdict.FELL and found.moved == ("b0",)
    assert found.timestep < settings_for(assembly).timestep


@pytest.mark.parametrize("side", [-1, 1])
def test_sliding_contacts_do_not_hop(side):
    """A stack whose lowest beds are half a degree from sliding: hopping blocks would creep and never come to rest."""
    floor = Part("floor", rectangle(-0.2, -0.05, 1.0, 0.05), fixed=True)
    blocks = [Part(f"b{k}", rectangle(0.001 * k, k * WIDTH / 2, WIDTH, WIDTH / 2)) for k in range(4)]
    assembly = Assembly("flat blocks", (floor, *blocks))
    angle = np.arctan(0.3) + side * np.deg2rad(0.5)
    found = let_go(assembly, angle, 0.3, facets(find_contacts(assembly).contacts))
    assert found.stands == (side < 0), found.reason
    assert found.stands == (found.max_share < 1e-3)


def test_a_critical_tilt_says_how_finely_it_is_known_and_both_ends_were_run():
    assembly = stack(3)
    graph = PartsGraph.of(assembly)
    contacts = graph.contacts
    model = pieces(assembly, contacts)
    found = physical_tilt(tilt_scene(assembly, model), graph, 0.0)
    assert 0.0 < found.within_rad <= 0.5 * RESOLUTION
    for side, stands in ((-1.0, True), (1.0, False)):
        assert let_go(assembly, found.critical_rad + side * found.within_rad, model=model).stands is stands


def test_the_tilt_table_needs_an_azimuth():
    with pytest.raises(InputError, match="0 azimuths"):
        azimuths(stack(1), 0)
