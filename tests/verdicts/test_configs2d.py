"""Every flat configuration, designed and judged from its written files alone."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import shapely

from mocca_robot import load, read_design, write_design
from mocca_robot.assembly import Assembly, Polygon, SupportFree
from mocca_robot.contacts.find import find_contacts
from mocca_robot.files.design_json import StoredDesign
from mocca_robot.geometry.polygons import to_shapely
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.motion.ways_out import insertion_rim, sweep_blockers
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import load_cases, state_cases
from mocca_robot.statics.solution import Status
from mocca_robot.verdicts.verification import part_overlap, verify
from planners import Designed, design

CONFIGS = Path(__file__).parents[2] / "configs"
FLAT = (
    *("m", "scarecrow", "stack", "tree", "leaning_tower_10", "leaning_tower_20", "leaning_tower_30"),
    *("leaning_tower_support_free", "deer"),
)


@dataclass(frozen=True)
class Result:
    source: Assembly
    designed: Designed
    stored: StoredDesign


@pytest.fixture(scope="module", params=FLAT)
def result(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Result:
    config = load(CONFIGS / f"{request.param}.yaml")
    designed = design(config.assembly, config.joints)
    folder = tmp_path_factory.mktemp(request.param)
    write_design(designed.design, folder)
    return Result(config.assembly, designed, read_design(folder))


def test_nine_flat_configurations_are_there() -> None:
    flat = {p.stem for p in CONFIGS.glob("*.yaml") if f"models/{p.stem}.svg" in p.read_text(encoding="utf-8")}
    assert flat == set(FLAT)


def test_the_input_is_not_in_equilibrium(result: Result) -> None:
    before = verify(result.source)
    fallen = [c for c in before.cases if c.result.status is Status.NOT_IN_EQUILIBRIUM]
    assert fallen and all(c.moving and c.result.kkt < 1e-6 for c in fallen)


def test_every_required_case_of_the_files_is_in_equilibrium(result: Result) -> None:
    built = result.stored.assembly
    graph = PartsGraph.of(built)
    cases = list(load_cases(graph, result.source.goals))
    if any(isinstance(g, SupportFree) for g in result.source.goals):
        assert len(cases) == len(state_cases(graph))
    for case in cases:
        verdict = solve_case(graph, case)
        assert verdict.result.stands, f"{case.name}: {verdict.moving} move, E = {verdict.result.infeasibility:.2g}"
        assert verdict.result.kkt < 1e-6


def test_forces_of_the_files_balance_every_part(result: Result) -> None:
    """Contact forces push only, and with the weights they sum to nothing: recomputed here from points and normals."""
    from mocca_robot.joints.joint import contact_rays
    from mocca_robot.statics.loads import case_wrenches

    built = result.stored.assembly
    graph = PartsGraph.of(built)
    contacts = graph.contacts
    pairs, points, normals = contact_rays(contacts)
    weight = sum(p.mass for p in built.parts) * float(np.linalg.norm(built.gravity))
    for case in load_cases(graph):
        forces = solve_case(graph, case).result.forces
        assert forces.min() >= -1e-9 * weight
        total = case_wrenches(case, graph).copy()
        vectors = forces[:, None] * normals
        torques = points[:, 0] * vectors[:, 1] - points[:, 1] * vectors[:, 0]
        for side, sign in ((1, 1.0), (0, -1.0)):
            np.add.at(total[:, :2], pairs[:, side], sign * vectors)
            np.add.at(total[:, 2], pairs[:, side], sign * torques)
        left = total[case.free]
        assert np.abs(left[:, :2]).max() < 1e-6 * weight
        assert np.abs(left[:, 2]).max() < 1e-6 * weight * built.size


def test_every_part_goes_in_along_axis_and_rim(result: Result) -> None:
    built, alpha = result.stored.assembly, result.source.alpha_rad
    ways = {i.part: i.direction for i in result.stored.insertion}
    assert set(ways) == {p.name for p in built.parts if not p.fixed}
    if alpha is None:
        return
    found = verify(built, directions=ways)
    assert len(found.insertions) == len(ways)
    for insertion in found.insertions:
        assert insertion.alpha_rad >= alpha - 1e-9 and insertion.assemblable, (insertion.part, insertion.blockers)


def test_rim_by_moved_copies(result: Result) -> None:
    """The same with other means: copies of the part on its way out, along axis and rim, stay clear of earlier parts."""
    built, alpha = result.stored.assembly, result.source.alpha_rad
    if alpha is None:
        return
    ways = {i.part: i.direction for i in result.stored.insertion}
    shapes = [to_shapely(p.shape) for p in built.parts if isinstance(p.shape, Polygon)]
    for index, part in enumerate(built.parts):
        if part.fixed:
            continue
        rim = insertion_rim(-ways[part.name], alpha)
        assert not sweep_blockers(built, index, rim)
        earlier = shapely.union_all(np.array(shapes[:index]))
        for way in rim:
            for share in (1e-4, 1e-3, 0.01, 0.05, 0.2, 1.0):
                moved = shapely.transform(shapes[index], lambda x, s=share, w=way: x + s * built.size * w)
                assert shapely.area(shapely.intersection(moved, earlier)) < 1e-9 * shapely.area(moved)


def test_parts_neither_overlap_nor_part(result: Result) -> None:
    built = result.stored.assembly
    assert part_overlap(built) <= 1e-9
    before = {c.parts for c in find_contacts(result.source).contacts}
    assert {c.parts for c in find_contacts(built).contacts} == before
    volumes = [sum(p.shape.volume for p in a.parts) for a in (result.source, built)]
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-9)


def test_files_say_what_the_run_said(result: Result) -> None:
    stored, memory = result.stored, result.designed.design
    assert result.designed.achieved and not result.designed.narrow and result.designed.impossible is None
    assert stored.assembly.sequence == memory.assembly.sequence
    for ours, theirs in zip(memory.assembly.parts, stored.assembly.parts, strict=True):
        assert isinstance(ours.shape, Polygon) and isinstance(theirs.shape, Polygon)
        assert np.array_equal(ours.shape.exterior, theirs.shape.exterior)
    assert stored.source is not None
    assert [p.name for p in stored.source.parts] == [p.name for p in result.source.parts]
