"""The designer's promises: what it calls stable is stable by other means, and a 'no' comes with its proof."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from benchmarks.random_assemblies import KINDS, random_assembly
from mocca_robot.assembly import Assembly, Equilibrium, Interlocking, Lateral, Part, Polygon
from mocca_robot.config.config import load
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import read_design, write_design
from mocca_robot.joints.joint import contact_rays
from mocca_robot.joints.options import JointOptions
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.cases import critical_tilt
from mocca_robot.statics.equilibrium import equilibrium
from mocca_robot.statics.loads import case_wrenches, load_cases
from mocca_robot.statics.mobility import loose_with_key
from mocca_robot.verdicts.verification import verify
from planners.cone_joints.designer import design


def rectangle(name: str, x: float, y: float, w: float, h: float, fixed: bool = False) -> Part:
    return Part(name, Polygon(np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])), fixed=fixed)


@pytest.mark.parametrize("support_free", [False, True])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(6))
def test_random_assemblies_end_in_a_verdict_that_an_independent_solve_confirms(
    kind: str, seed: int, support_free: bool
) -> None:
    assembly = random_assembly(kind, seed, support_free)
    outcome = design(assembly)
    built = outcome.design.assembly
    check = verify(built, directions={i.part: i.direction for i in outcome.design.insertion})
    assert check.part_overlap <= 1e-9
    total_before = sum(p.shape.volume for p in assembly.parts)
    assert sum(p.shape.volume for p in built.parts) == pytest.approx(total_before, rel=1e-9)
    if not outcome.achieved:
        explained = outcome.impossible is not None or outcome.narrow
        unmet = max(c.infeasibility_after for c in outcome.design.load_cases) > 1e-12
        assert explained or unmet or not check.assemblable
        return
    assert all(i.alpha_rad >= np.deg2rad(5.0) - 1e-9 for i in check.insertions)
    pairs, points, normals = contact_rays(check.contacts)
    for case in load_cases(check.graph):
        there = case.present[pairs].all(axis=1)
        result = equilibrium(
            pairs[there],
            points[there],
            normals[there],
            case_wrenches(case, check.graph),
            fixed=~case.free,
            about=np.array([p.centroid for p in built.parts]),
            solver="clarabel",
        )
        assert not isinstance(result, list)
        assert result.infeasibility < 1e-10, case.name


def test_most_random_assemblies_can_be_designed() -> None:
    achieved = [design(random_assembly(kind, seed)).achieved for kind in KINDS for seed in range(20, 25)]
    assert sum(achieved) >= 0.6 * len(achieved)


def test_an_overhang_that_no_joint_can_hold_is_refused_with_its_collapse_motion() -> None:
    parts = (rectangle("table", 0, -0.05, 0.1, 0.05, True), rectangle("plank", 0.08, 0.0, 0.4, 0.02))
    outcome = design(Assembly("plank", parts))
    assert not outcome.achieved
    assert outcome.impossible is not None
    name, proof = outcome.impossible
    assert name == "gravity"
    assert proof.infeasibility > 1e-4
    # The far end goes down: the plank turns clockwise about the table's edge.
    assert proof.motions[1, 2] < 0


def test_impossible_is_monotone_in_the_allowed_slope() -> None:
    """A steep bed that blunt joints cannot hold is held by sharper ones."""
    slope = np.deg2rad(50.0)
    c, s = np.cos(slope), np.sin(slope)
    turn = np.array([[c, s], [-s, c]])
    block = np.array([[0.0, 0.0], [0.06, 0.0], [0.06, 0.02], [0.0, 0.02]]) @ turn.T
    base = np.array([block[0], [block[0, 0], block[1, 1] - 0.05], [block[1, 0], block[1, 1] - 0.05], block[1]])
    assembly = Assembly("bed", (Part("base", Polygon(base), fixed=True), Part("block", Polygon(block))))
    blunt = design(assembly, JointOptions(max_slope_rad=float(np.deg2rad(20.0))))
    sharp = design(assembly, JointOptions(max_slope_rad=float(np.deg2rad(75.0))))
    assert blunt.impossible is not None
    assert sharp.achieved


def test_lateral_goal_raises_the_critical_tilt_beyond_its_angle() -> None:
    parts = (
        rectangle("ground", -0.1, -0.05, 0.3, 0.05, True),
        rectangle("lower", 0.0, 0.0, 0.1, 0.05),
        rectangle("upper", 0.0, 0.05, 0.1, 0.05),
    )
    angle = float(np.deg2rad(15.0))
    outcome = design(Assembly("tower", parts, goals=(Lateral(angle),)))
    assert outcome.achieved
    built = outcome.design.assembly
    flat, graph = PartsGraph.of(outcome.design.source), PartsGraph.of(built)
    for azimuth in (0.0, np.pi):
        assert critical_tilt(flat, azimuth) < 1e-6
        assert critical_tilt(graph, azimuth) >= angle


def test_interlocking_holds_every_part_but_the_key() -> None:
    """Two halves around a plug: with the key held nothing moves; planar contacts alone let everything go."""
    parts = (
        rectangle("left", 0.0, 0.0, 0.05, 0.1, True),
        rectangle("middle", 0.05, 0.0, 0.05, 0.1),
        rectangle("right", 0.1, 0.0, 0.05, 0.1),
    )
    outcome = design(Assembly("row", parts, goals=(Interlocking("middle"),), alpha_rad=None))
    assert not outcome.achieved
    assert outcome.impossible is not None, "a row can always be pulled apart: no height field holds it"


def test_what_slides_along_its_contacts_does_not_interlock() -> None:
    """A board between table and weight: with the weight held nothing opens, but the board slides out."""
    parts = (
        rectangle("table", 0.0, 0.0, 0.3, 0.1, True),
        rectangle("board", 0.0, 0.1, 0.3, 0.02),
        rectangle("weight", 0.1, 0.12, 0.1, 0.05),
    )
    outcome = design(Assembly("pile", parts, goals=(Interlocking("weight"),), alpha_rad=None))
    loose = loose_with_key(PartsGraph.of(outcome.design.assembly))
    assert outcome.achieved == (loose is None)
    assert loose is None or loose.moving == ("board",)


def test_a_part_between_parallel_walls_is_narrow_by_name() -> None:
    parts = (
        rectangle("left", 0.0, 0.0, 0.03, 0.1, True),
        rectangle("right", 0.08, 0.0, 0.03, 0.1, True),
        rectangle("plug", 0.03, 0.02, 0.05, 0.05),
    )
    outcome = design(Assembly("slot", parts))
    assert not outcome.achieved
    assert [n.part for n in outcome.narrow] == ["plug"]
    assert set(outcome.narrow[0].blockers) == {"left", "right"}
    assert outcome.narrow[0].alpha_rad == pytest.approx(0.0, abs=1e-9)


def test_options_bound_the_built_joints() -> None:
    assembly = random_assembly("wall", 3)
    options = JointOptions(kinds=("n",), max_slope_rad=float(np.deg2rad(45.0)), max_height=0.3)
    outcome = design(assembly, options)
    for joint in outcome.design.joints:
        steepest = (joint.facet_normals @ joint.contact.normal).min()
        assert steepest >= np.cos(np.deg2rad(45.0)) - 1e-6
        assert joint.kind in ("planar", "n")


def test_same_input_gives_the_same_output() -> None:
    assembly = random_assembly("wall", 5)
    first, second = design(assembly).design.assembly, design(assembly).design.assembly
    for a, b in zip(first.parts, second.parts, strict=True):
        assert isinstance(a.shape, Polygon) and isinstance(b.shape, Polygon)
        assert np.array_equal(a.shape.exterior, b.shape.exterior)


def test_design_moves_with_the_assembly() -> None:
    """A translated and enlarged copy gets the same joints, translated and enlarged."""
    assembly = random_assembly("stack", 4)
    scale, offset = 7.0, np.array([3.0, -2.0])
    shapes = [Polygon(p.shape.exterior * scale + offset) for p in assembly.parts if isinstance(p.shape, Polygon)]
    here, there = design(assembly).design, design(assembly.with_shapes(shapes)).design
    for a, b in zip(here.joints, there.joints, strict=True):
        assert a.kind == b.kind
        assert b.vertices == pytest.approx(a.vertices * scale + offset, abs=1e-6)


def test_parts_that_overlap_or_float_are_refused_by_name() -> None:
    ground = rectangle("ground", 0, 0, 0.2, 0.02, True)
    with pytest.raises(InputError, match=r"'a' and 'b' overlap by .* mm"):
        design(Assembly("x", (ground, rectangle("a", 0, 0.02, 0.05, 0.05), rectangle("b", 0.04, 0.02, 0.05, 0.05))))
    with pytest.raises(InputError, match="'a' floats free"):
        design(Assembly("x", (ground, rectangle("a", 0, 0.2, 0.05, 0.05))))
    with pytest.raises(InputError, match="No part of 'x' is fixed"):
        design(Assembly("x", (rectangle("a", 0, 0, 0.05, 0.05), rectangle("b", 0, 0.05, 0.05, 0.05))))


def test_a_drawing_with_few_digits_gets_its_reserves_too() -> None:
    """Corners that miss the common line by less than the contact tolerance cost neither room nor robustness."""
    rng = np.random.default_rng(0)
    assembly = random_assembly("stack", 2)
    shapes = [
        Polygon(p.shape.exterior + rng.uniform(-3e-7, 3e-7, p.shape.exterior.shape))
        for p in assembly.parts
        if isinstance(p.shape, Polygon)
    ]
    exact, rounded = design(assembly), design(assembly.with_shapes(shapes))
    assert exact.achieved and rounded.achieved
    assert rounded.margin_rad == exact.margin_rad > 0.0


def test_an_arch_closes_although_its_haunches_bar_the_widest_ways_in() -> None:
    """The cone with most room at the last haunch but one just clears the haunch across, until it has joints."""
    outer, inner, count = 0.12, 0.095, 9
    base = Polygon(np.array([[-0.13, -0.01], [0.13, -0.01], [0.13, 0.0], [-0.13, 0.0]]))
    parts = [Part("base", base, fixed=True)]
    for k in (0, 8, 7, 1, 2, 6, 3, 5, 4):
        a, b = np.pi * k / count, np.pi * (k + 1) / count
        ring = [r * np.array([np.cos(t), np.sin(t)]) for r, t in ((inner, a), (outer, a), (outer, b), (inner, b))]
        parts.append(Part(f"v{k}", Polygon(np.round(ring, 5))))
    outcome = design(Assembly("arch", tuple(parts), goals=(Equilibrium(),), alpha_rad=np.deg2rad(5.0)))
    assert outcome.achieved
    judged = verify(outcome.design.assembly, directions={i.part: i.direction for i in outcome.design.insertion})
    assert judged.stands and judged.assemblable


def test_a_bed_that_is_drawn_to_a_micrometre_is_designed() -> None:
    """The segment that two outlines share, cut from rounded corners, is not exactly across the contact's normal."""
    mm = {
        "ground": [[0, -20], [200, -20], [200, 0], [0, 0]],
        "wedge": [[40, 0], [160, 0], [160, 40], [40, 20]],
        "block": [[60, 23.333], [140, 36.667], [140, 70], [60, 60]],
    }
    parts = tuple(Part(n, Polygon(np.array(p) * 1e-3), fixed=n == "ground") for n, p in mm.items())
    outcome = design(Assembly("rounded", parts, goals=(Equilibrium(),), alpha_rad=np.deg2rad(5.0)))
    assert outcome.achieved and len(outcome.design.joints) == 2


@pytest.mark.parametrize("seed", [1, 4])
def test_piecewise_planar_joints_hold_too_and_have_flat_flanks(seed: int) -> None:
    outcome = design(random_assembly("wall", seed), JointOptions(piecewise_planar=True))
    assert outcome.achieved
    curved = [j for j in outcome.design.joints if not j.is_planar]
    assert curved and all(j.kind.startswith("piecewise_") and len(j.facets) <= 5 for j in curved)
    check = verify(outcome.design.assembly)
    assert check.stands and check.part_overlap <= 1e-9


def test_a_direction_that_the_user_gives_is_kept() -> None:
    """The corner stone may leave up or to the right; it is asked to leave straight up, and does."""
    parts = (
        rectangle("ground", 0.0, -0.05, 0.2, 0.05, True),
        rectangle("wall", 0.0, 0.0, 0.05, 0.1, True),
        rectangle("stone", 0.05, 0.0, 0.08, 0.05),
    )
    asked = np.array([-0.35, -1.0]) / np.hypot(0.35, 1.0)
    outcome = design(Assembly("corner", parts, goals=(Lateral(float(np.deg2rad(10.0))),)), insertion={"stone": asked})
    (insertion,) = outcome.design.insertion
    assert insertion.direction == pytest.approx(asked)
    assert outcome.achieved and insertion.alpha_rad >= np.deg2rad(5.0)
    blocked = design(Assembly("corner", parts), insertion={"stone": np.array([0.0, -1.0])})
    assert [n.part for n in blocked.narrow] == ["stone"], "straight down slides along the wall: no cone at all"


@pytest.mark.parametrize("beyond_mm", [4.0, 8.0])
def test_a_block_whose_centroid_is_past_the_edge_is_held_by_moving_it(beyond_mm: float) -> None:
    """Fig. 17e: only a joint that takes mass from the far side can hold it; centroids move with the joints."""
    width = 2e-3 * (60.0 + beyond_mm)
    parts = (rectangle("base", 0.0, -0.05, 0.06, 0.05, True), rectangle("top", 0.0, 0.0, width, 0.04))
    assert design(Assembly("overhang", parts)).achieved


def test_a_leaning_wall_from_a_folder_of_meshes_is_built_without_support(tmp_path: Path) -> None:
    """Own input: STL files in millimetres, one per block, leaning by 8° on a slab that leans as well."""
    turn = trimesh.transformations.rotation_matrix(np.deg2rad(8.0), [0.0, 1.0, 0.0])
    for name, extents, at in (
        ("ground", (300.0, 500.0, 60.0), (0.0, 0.0, -30.0)),
        ("left", (100.0, 200.0, 100.0), (0.0, -100.0, 50.0)),
        ("right", (100.0, 200.0, 100.0), (0.0, 100.0, 50.0)),
        ("top", (100.0, 200.0, 100.0), (0.0, 0.0, 150.0)),
    ):
        block = trimesh.creation.box(extents)
        block.apply_translation(at)
        block.apply_transform(turn)
        block.export(tmp_path / f"{name}.stl")
    keys = {
        "units": "mm",
        "fixed": ["ground"],
        "goal": "support_free",
        "alpha_deg": 5,
        "sequence": ["left", "right", "top"],
    }
    config = load(tmp_path, keys)
    assert config.assembly.size == pytest.approx(0.62, abs=0.05)
    found = design(config.assembly, config.joints)
    assert found.achieved
    assert min(case.infeasibility_before for case in found.design.load_cases) > 1e-4, "flat, every state slides"
    written = read_design(write_design(found.design, tmp_path / "out"))
    judged = verify(written.assembly, directions={i.part: np.asarray(i.direction) for i in written.insertion})
    assert judged.stands and judged.assemblable
    assert judged.part_overlap < 1e-6
    assert len(judged.cases) == 3, "one per block placed"
