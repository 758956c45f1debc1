"""The report is one sound, self-contained file; it names everything, believes nobody and says what disagrees."""

from __future__ import annotations

import base64
import dataclasses
import json
import re
import struct
import xml.etree.ElementTree as ET
import zlib
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.ndimage
import shapely

from mocca_robot.assembly import Assembly, Equilibrium, Lateral, Mesh, Part, Polygon, SupportFree
from mocca_robot.cli import main
from mocca_robot.contacts.contact import Contact
from mocca_robot.contacts.find import find_contacts
from mocca_robot.design import CaseResult, Design, Insertion
from mocca_robot.joints.build2d import build_parts_2d
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.joints.spline import polyline_joint
from mocca_robot.motion.insertion import InsertionVerdict
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report import cone_plots, drawing2d, drawing3d, figures, pictures, raster
from mocca_robot.report.comparison import Variant, comparison_page
from mocca_robot.report.data import ReportData, Tilt, collect
from mocca_robot.report.film import films
from mocca_robot.report.findings import disagreements, states, tilt_gaps
from mocca_robot.report.markup import esc, script_json, significant
from mocca_robot.report.page import report_page, write_report
from mocca_robot.report.palette import part_colours
from mocca_robot.report.scene3d import packed
from mocca_robot.report.summary import summary
from mocca_robot.statics.cases import solve_case
from mocca_robot.statics.loads import load_cases, state_cases
from mocca_robot.statics.solution import Status
from mocca_robot.statics.tilt_reserve import TiltReserve
from mocca_robot.verdicts.physics import (
    InsertionTrial,
    PartInsertion,
    Simulation,
    StateVerdict,
    TiltVerdict,
    Verdict,
)
from mocca_robot.verdicts.verification import Verification

HOSTILE = "</script><script>alert(1)</script> & \"'<b>"


def stack(count: int = 3, tilt_deg: float = 5.0, name: str = "stack") -> Assembly:
    """A stack on a slope: it slides off with planar contacts."""
    t = np.deg2rad(tilt_deg)
    turn = np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]])
    parts = [Part("ground", Polygon(np.array([[0, -0.1], [0.2, -0.1], [0.2, 0], [0, 0]]) @ turn.T), fixed=True)]
    for k in range(count):
        block = np.array([[0, k * 0.1], [0.2, k * 0.1], [0.2, (k + 1) * 0.1], [0, (k + 1) * 0.1]])
        parts.append(Part(HOSTILE if k == 1 else f"b{k}", Polygon(block @ turn.T)))
    return Assembly(name, tuple(parts), (Equilibrium(), SupportFree(), Lateral(np.deg2rad(2.0))), np.deg2rad(5.0))


def bump(contact: Contact, height: float = 0.03) -> Joint:
    x = np.linspace(0.0, 1.0, 17)
    p1, p2 = contact.polygon
    points = p1 + x[:, None] * (p2 - p1) + (height * np.sin(np.pi * x) ** 2)[:, None] * contact.normal
    return polyline_joint(contact, "n", contact.normal, points, {"h": height})


def designed(curved: bool = True, **changes: Any) -> Design:
    source = stack()
    contacts = find_contacts(source).contacts
    joints = tuple(bump(c) if curved else planar(c) for c in contacts)
    ways = tuple(Insertion(source.parts[c.parts[1]].name, -c.normal, np.deg2rad(5.0)) for c in contacts)
    cases = (CaseResult("gravity", 0.01, 0.0),)
    built = build_parts_2d(source, joints)
    design = Design(
        source=source,
        assembly=built,
        joints=joints,
        insertion=ways,
        load_cases=cases,
        seconds={"total": 0.5},
        notes=("kept planar: <x>",),
    )
    return dataclasses.replace(design, **changes)


def solid_data() -> ReportData:
    """Two boxes on a fixed one; verdicts from statics, insertions by hand."""

    def box(z: float, shift: float) -> Mesh:
        v = np.array([[x, y, z + h] for h in (0, 0.1) for y in (0, 0.2) for x in (shift, shift + 0.2)])
        quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
        return Mesh(v, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]))

    names = (("ground", 0.0), (HOSTILE, 0.05), ("top", 0.17))
    parts = tuple(Part(n, box(0.1 * k, s), fixed=k == 0) for k, (n, s) in enumerate(names))
    assembly = Assembly("boxes", parts, (Equilibrium(),), np.deg2rad(5.0))
    contacts = tuple(
        Contact(
            (k, k + 1),
            np.array([[s, 0, z], [0.2 + r, 0, z], [0.2 + r, 0.2, z], [s, 0.2, z]]),
            np.array([0.0, 0.0, 1.0]),
        )
        for k, (r, s, z) in enumerate(((0.0, 0.05, 0.1), (0.05, 0.17, 0.2)))
    )
    joints = tuple(
        Joint(contact=c, kind="planar", direction=c.normal, vertices=c.polygon, facets=np.array([[0, 1, 2], [0, 2, 3]]))
        for c in contacts
    )
    down = np.array([0.0, 0.0, -1.0])
    ways = tuple(Insertion(p.name, down, np.deg2rad(5.0)) for p in parts[1:])
    design = Design(source=assembly, assembly=assembly, joints=joints, insertion=ways, load_cases=())
    graph = PartsGraph.of(assembly, contacts)
    cases = tuple(solve_case(graph, c) for c in load_cases(graph))
    inserted = tuple(InsertionVerdict(p.name, np.pi / 2, assembly.alpha_rad, (), False) for p in parts[1:])
    checked = Verification(graph, cases, inserted, 0.0)
    steps = [solve_case(graph, c) for c in state_cases(graph)]
    tilts = [Tilt(float(a), 0.1) for a in np.linspace(0, 2 * np.pi, 8, endpoint=False)]
    return collect(design, before=checked, after=checked, states=steps, tilts=tilts, versions={"x": "1"})


def inserted(part: str, inside: int = 4, outside: int = 0) -> PartInsertion:
    """Four ways inside the cone, two outside, of which so many succeed."""
    ways = [("rim", k < inside) for k in range(4)] + [("outside", k < outside) for k in range(2)]
    trials = tuple(InsertionTrial(part=part, kind=kind, direction=(0.0, -1.0), succeeded=ok) for kind, ok in ways)
    return PartInsertion(part=part, axis=(0.0, -1.0), realised_rad=0.2, tried_rad=0.1, trials=trials)


def simulated(design: Design, **changes: Any) -> Simulation:
    names = [p.name for p in design.assembly.parts if not p.fixed]
    states = tuple(StateVerdict(placed=n, verdict=Verdict.STANDS) for n in names)
    entries = tuple(inserted(n) for n in names)
    found = Simulation(name="x", engine="mujoco 9", seconds={"total": 1.5}, states=states, insertion=entries)
    return dataclasses.replace(found, **changes)


@pytest.fixture(scope="module")
def flat() -> ReportData:
    return collect(designed(), versions={"numpy": "1"})


@pytest.fixture(scope="module")
def solid() -> ReportData:
    return solid_data()


@pytest.mark.parametrize("kind", ["flat", "solid"])
def test_page_is_well_formed_and_asks_the_network_for_nothing(kind: str, request: pytest.FixtureRequest) -> None:
    page = report_page(request.getfixturevalue(kind))
    ET.fromstring(page.split("\n", 1)[1])
    links = set(re.findall(r"https?://[^\"'\s<]+", page))
    assert links <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xhtml"}
    assert not re.search(r"<link|@import|\bsrc=|url\((?!#)|fetch\(|XMLHttpRequest|\bimport\b", page)
    assert "default-src 'none'" in page


@pytest.mark.parametrize("kind", ["flat", "solid"])
def test_identifiers_are_unique_and_every_link_has_its_target(kind: str, request: pytest.FixtureRequest) -> None:
    page = report_page(request.getfixturevalue(kind))
    found = re.findall(r'\bid="([^"]+)"', page)
    assert len(found) == len(set(found))
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(found)
    assert set(re.findall(r"(?:fill:)url\(#([\w-]+)\)", page)) <= set(found)


@pytest.mark.parametrize("kind", ["flat", "solid"])
def test_hostile_names_stay_text(kind: str, request: pytest.FixtureRequest) -> None:
    page = report_page(request.getfixturevalue(kind))
    assert "<script>alert" not in page and "<b>'" not in page
    root = ET.fromstring(page.split("\n", 1)[1])
    space = "{http://www.w3.org/1999/xhtml}"
    assert any("".join(c.itertext()) == HOSTILE for c in root.iter(f"{space}code"))
    steps = next(s for s in root.iter(f"{space}script") if s.get("id") == "steps")
    titles = [s["title"] for s in json.loads(steps.text or "")]
    assert any(HOSTILE in t for t in titles)


def test_script_json_survives_every_ending_and_round_trips() -> None:
    value = {"</script>": ["<!--", "&amp;", "\u2028", "]]>"], "x": float("nan")}
    text = script_json(value)
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == {"</script>": ["<!--", "&amp;", "\u2028", "]]>"], "x": None}


def test_characters_that_xml_forbids_are_replaced() -> None:
    assert esc("a\x00\x1bb\ud800") == "a\ufffd\ufffdb\ufffd"


@pytest.mark.parametrize("kind", ["flat", "solid"])
def test_every_part_state_and_load_case_appears(kind: str, request: pytest.FixtureRequest) -> None:
    data = request.getfixturevalue(kind)
    page = report_page(data)
    for part in data.design.assembly.parts:
        assert page.count(esc(part.name)) >= 3
    for k in range(len(states(data))):
        assert f'data-step="{k + 1}"' in page
    for verdict in (*data.before.cases, *data.after.cases):
        assert f'data-case="{esc(verdict.case.name)}"' in page


def test_same_data_same_text(flat: ReportData, tmp_path: Path) -> None:
    first = write_report(tmp_path / "new" / "report.html", flat)
    again = collect(designed(), versions={"numpy": "1"})
    assert first.read_text(encoding="utf-8") == report_page(again)
    assert [p.name for p in first.parent.iterdir()] == ["report.html"]


def test_without_simulation_it_says_so_and_with_it_that_they_agree(flat: ReportData) -> None:
    assert "Not simulated" in report_page(flat)
    agreeing = dataclasses.replace(flat, simulation=simulated(flat.design))
    assert all(s.statics for s in states(agreeing)), "a 3 cm bump holds a 5° slope"
    assert disagreements(agreeing) == ()
    page = report_page(agreeing)
    assert ">Agrees<" in page and 'id="disagreements"' not in page and "mujoco 9" in page


def test_what_does_not_hold_stands_at_the_top(flat: ReportData) -> None:
    reason = "Does not stand (finished, under gravity): 'shelf' would move."
    page = report_page(dataclasses.replace(flat, negative=(reason,)))
    assert page.count(esc(reason)) == 1
    assert page.index(esc(reason)) < page.index("<main>")
    assert 'id="negative"' not in report_page(flat)


def test_every_kind_of_disagreement_is_listed(flat: ReportData) -> None:
    names = [s.part for s in states(flat)]
    told = simulated(
        flat.design,
        states=(StateVerdict(placed=names[0], verdict=Verdict.FELL, moved=(names[0],)),),
        tilt=(TiltVerdict(azimuth_rad=0.0, critical_rad=0.7, statics_rad=0.02, friction=0.5),),
        insertion=(inserted(names[0], inside=3, outside=1),),
    )
    found = disagreements(dataclasses.replace(flat, simulation=told))
    assert len(found) == 4
    page = report_page(dataclasses.replace(flat, simulation=told))
    alarm = page[page.index('id="disagreements"') :]
    assert all(esc(f) in alarm for f in found) and ">Disagrees<" in page


def test_states_are_compared_with_the_friction_that_physics_had() -> None:
    """By its own statics, without friction, the stack slides; with the friction that physics had, it stands in both."""
    data = collect(dataclasses.replace(designed(curved=False), load_cases=()), tilts=())
    assert all(s.statics is False for s in states(data))
    rubbed = tuple(
        StateVerdict(placed=s.part, verdict=Verdict.STANDS, statics=Status.EQUILIBRIUM, friction=0.3)
        for s in states(data)
    )
    compared = dataclasses.replace(data, simulation=simulated(data.design, states=rubbed))
    assert all(s.agree for s in states(compared)) and disagreements(compared) == ()
    assert "with friction 0.3" in report_page(compared) and "with friction 0.3" not in report_page(data)


def test_a_claim_the_geometry_does_not_hold_is_a_disagreement() -> None:
    claimed = collect(designed(curved=False), tilts=())
    assert any("claims equilibrium" in d for d in disagreements(claimed))
    assert ">Falls<" in report_page(claimed)


def test_unstable_states_need_support_only_where_support_free_was_not_asked_for() -> None:
    asked = collect(designed(curved=False), tilts=())
    assert not any(s.needs_support for s in states(asked))
    design = designed(curved=False)
    relaxed = dataclasses.replace(design, assembly=dataclasses.replace(design.assembly, goals=(Equilibrium(),)))
    found = states(collect(relaxed, tilts=()))
    assert [s.needs_support for s in found] == [True] * (len(found) - 1) + [False]
    assert "needs support" in report_page(collect(relaxed, tilts=()))


def test_neighbours_differ_in_colour(flat: ReportData) -> None:
    colours = part_colours(flat.after.graph)
    free = ~flat.design.assembly.fixed
    for contact in flat.after.contacts:
        i, j = contact.parts
        assert not (free[i] and free[j]) or colours[i] != colours[j]


def test_merged_forces_balance_the_weight_above(flat: ReportData) -> None:
    verdict = flat.after.cases[0]
    pairs, _, vectors = drawing2d.merged_forces(flat.after.contacts, verdict.result.forces)
    on_first = vectors[(pairs == [0, 1]).all(axis=1)].sum(axis=0)
    mass = sum(p.mass for p in flat.design.assembly.parts if not p.fixed)
    np.testing.assert_allclose(on_first, -mass * flat.design.assembly.gravity, atol=1e-4 * 9.81 * mass)


def test_collapse_displacement_reaches_as_far_as_it_says(flat: ReportData) -> None:
    source, verdict = flat.design.source, flat.before.cases[0]
    assert not verdict.result.stands
    steps = drawing2d.displaced(source, verdict.result.motions)
    speeds = [np.linalg.norm(s[:2]) for s in steps]
    assert 0.0 < max(speeds) <= drawing2d.GHOST_REACH * source.size * (1 + 1e-9)
    np.testing.assert_allclose(np.cross(steps, verdict.result.motions)[1:], 0.0, atol=1e-12)


def test_free_interval_is_the_dual_of_the_normals() -> None:
    rng = np.random.default_rng(3)
    axis = np.array([0.6, 0.8])
    for _ in range(50):
        normals = axis + rng.normal(0.0, 0.7, (3, 2))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        interval = drawing2d.free_interval(normals, axis)
        angles = np.linspace(-np.pi, np.pi, 721)
        base = np.arctan2(axis[1], axis[0])
        directions = np.stack([np.cos(base + angles), np.sin(base + angles)], axis=1)
        free = (directions @ normals.T >= 0).all(axis=1)
        if interval is None:
            assert (normals @ axis).min() < 1e-9
            continue
        inside = (angles >= interval[0]) & (angles <= interval[1])
        near_rim = np.minimum(np.abs(angles - interval[0]), np.abs(angles - interval[1])) < 1e-6
        assert (inside == free)[~near_rim].all()


def test_free_reach_lies_on_the_rim_of_the_cone() -> None:
    rng = np.random.default_rng(4)
    axis = np.array([0.0, 0.6, 0.8])
    normals = axis + rng.normal(0.0, 0.4, (6, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    axes, azimuths = cone_plots.tangent_axes(axis), np.linspace(0, 2 * np.pi, 20)
    reach = cone_plots.free_reach(normals, axis, axes, azimuths)
    around = np.cos(azimuths)[:, None] * axes[0] + np.sin(azimuths)[:, None] * axes[1]
    rim = np.cos(reach)[:, None] * axis + np.sin(reach)[:, None] * around
    np.testing.assert_allclose((rim @ normals.T).min(axis=1), 0.0, atol=1e-9)
    assert (cone_plots.free_reach(-normals, axis, axes, azimuths) == 0.0).all()


def test_conic_section_holds_exactly_the_motions_of_the_cone() -> None:
    contact = find_contacts(stack()).contacts[0]
    normals = bump(contact).motion_cone(contact.centre, 0.1).normals
    frame = cone_plots.section_frame(normals)
    corners = cone_plots.section_polygon(normals, frame, 8.0)
    motions = frame[0] + corners @ frame[1:]
    assert len(corners) >= 3 and (motions @ normals.T).min() >= -1e-9
    at_limit = np.abs((motions @ normals.T).min(axis=1)) < 1e-9
    assert (at_limit | (np.abs(corners).max(axis=1) > 8.0 - 1e-9)).all()


def test_slope_and_radius_are_those_of_the_curve() -> None:
    contact = find_contacts(stack()).contacts[0]
    height, length = 0.02, contact.measure
    slope, radius = pictures.joint_shape(bump(contact, height))
    assert slope == pytest.approx(np.arctan(np.pi * height / length), rel=0.04)
    assert radius == pytest.approx(length**2 / (2 * np.pi**2 * height), rel=0.05)
    assert pictures.joint_shape(planar(contact)) == (0.0, np.inf)


def test_packed_mesh_is_the_mesh(solid: ReportData) -> None:
    mesh = solid.design.assembly.parts[1].shape
    assert isinstance(mesh, Mesh)
    told = packed(mesh)
    grid = np.frombuffer(base64.b64decode(told["vertices"]), "<u2").reshape(-1, 3)
    faces = np.frombuffer(base64.b64decode(told["faces"]), "<u2").reshape(-1, 3)
    edges = np.frombuffer(base64.b64decode(told["edges"]), "<u2").reshape(-1, 2)
    np.testing.assert_allclose(np.array(told["low"]) + grid * told["step"], mesh.vertices, atol=1e-5 * 0.2)
    assert (faces == mesh.faces).all() and len(edges) == 12, "a box has twelve edges, diagonals are none"


def cube(side: float, at: tuple[float, float, float]) -> Mesh:
    v = np.array([[x, y, z] for z in (0, side) for y in (0, side) for x in (0, side)]) + at
    quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    return Mesh(v, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]))


def test_the_camera_sees_what_is_in_front_and_covers_each_face_once() -> None:
    """Seen from above: a small cube on a large one, to the half pixel."""
    above = np.eye(3)
    scene = [cube(0.4, (0.0, 0.0, 0.0)), cube(0.1, (0.1, 0.2, 0.4)), cube(0.1, (0.1, 0.1, -0.1))]
    seen = raster.look(scene, above, 100.0, np.array([-0.05, -0.05]), 50, 50)
    assert (seen.part == 0).sum() == 40 * 40 - 10 * 10 and (seen.part == 1).sum() == 10 * 10
    assert not (seen.part == 2).any(), "hidden below"
    rows, columns = np.nonzero(seen.part == 1)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (15, 24, 15, 24), "the top row is the far one"
    np.testing.assert_allclose(seen.depth[seen.part == 0], 40.0)
    np.testing.assert_allclose(seen.normals[seen.face[seen.part >= 0]] - [0.0, 0.0, 1.0], 0.0, atol=1e-12)


def test_depth_is_that_of_the_plane_and_lines_run_where_faces_turn() -> None:
    axes = drawing3d.camera()
    seen = raster.look([cube(1.0, (-0.5, -0.5, -0.5))], axes, 60.0, np.array([-1.0, -1.0]), 120, 120)
    hit = seen.part == 0
    rows, columns = np.nonzero(hit)
    flat = np.stack([(columns + 0.5) / 60.0 - 1.0, 1.0 - (rows + 0.5) / 60.0, seen.depth[hit] / 60.0], axis=1)
    world = flat @ axes
    np.testing.assert_allclose(np.abs(world).max(axis=1), 0.5, atol=1e-9)
    corners = cube(1.0, (-0.5, -0.5, -0.5)).vertices @ axes[:2].T
    assert hit.sum() == pytest.approx(3600 * shapely.MultiPoint(corners).convex_hull.area, rel=0.01)
    groups = {tuple(n) for n in np.round(seen.normals[seen.face[hit]], 9)}
    assert len(groups) == 3, "three faces of a cube"
    inside = scipy.ndimage.binary_erosion(hit, iterations=3)
    assert 100 < (raster.outlines(seen) & inside).sum() < 600, "its three inner edges"


def test_a_picture_is_a_png_of_its_pixels() -> None:
    pixels = np.random.default_rng(0).integers(1, 40, (5, 7, 4), dtype=np.uint8) * 6
    data = raster.png(pixels)
    assert data.startswith(b"\x89PNG") and struct.unpack(">II", data[16:24]) == (7, 5)

    def chunk(kind: bytes) -> bytes:
        start = data.index(kind)
        (length,) = struct.unpack(">I", data[start - 4 : start])
        assert struct.unpack(">I", data[start + 4 + length : start + 8 + length])[0] == zlib.crc32(
            data[start : start + 4 + length]
        )
        return data[start + 4 : start + 4 + length]

    raw = np.frombuffer(zlib.decompress(chunk(b"IDAT")), np.uint8).reshape(5, 8)
    palette = np.column_stack(
        [np.frombuffer(chunk(b"PLTE"), np.uint8).reshape(-1, 3), np.frombuffer(chunk(b"tRNS"), np.uint8)]
    )
    assert (raw[:, 0] == 0).all(), "no filter"
    assert np.abs(palette[raw[:, 1:]].astype(int) - pixels).max() <= raster.COARSE // 2


def test_rare_colours_give_way_to_frequent_ones() -> None:
    pixels = np.full((60, 60, 4), 255, dtype=np.uint8)
    pixels[:30, :, :3] = [12, 120, 240]
    pixels[30, :, 0] = np.arange(60) * 4
    pixels[31:50, ::3, :3] = np.random.default_rng(1).integers(0, 255, (19, 20, 3))
    colours, index = raster.indexed(pixels)
    assert len(colours) == 256
    apart = np.abs(colours[index].astype(int) - pixels)
    assert apart[:30].max() <= raster.COARSE // 2 and apart[59].max() == 0
    assert raster.indexed(np.zeros((2, 2, 4), dtype=np.uint8))[0].tolist() == [[0, 0, 0, 0]], "nothing stays clear"


def test_exploded_parts_keep_their_shape_and_move_away_from_the_middle(solid: ReportData) -> None:
    parts = [p.shape for p in solid.design.assembly.parts]
    for before, after in zip(parts, drawing3d.exploded(solid.design.assembly, 0.5)):
        assert isinstance(before, Mesh)
        shift = after.vertices - before.vertices
        np.testing.assert_allclose(shift - shift[0], 0.0, atol=1e-12)
        assert (after.faces == before.faces).all() and shift[0, 2] >= 0.0


@pytest.mark.parametrize("kind", ["flat", "solid"])
def test_figures_stand_alone(kind: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    written = figures.write_figures(tmp_path / "figures", request.getfixturevalue(kind))
    assert {p.name for p in written} >= {"design.svg", "collapse.svg", "tilt.svg"}
    for path in written:
        text = path.read_text(encoding="utf-8")
        assert ET.fromstring(text).tag == "{http://www.w3.org/2000/svg}svg"
        assert "var(" not in text and "<style>" in text


def test_comparison_names_every_variant_and_its_verdicts(flat: ReportData) -> None:
    variants = (
        Variant(
            name="planar <1>",
            assembly=flat.design.source,
            verification=flat.before,
            physics_stands=True,
            deadlocked=True,
        ),
        Variant(
            name="cone joints",
            assembly=flat.design.assembly,
            verification=flat.after,
            joints=flat.design.joints,
            insertion=flat.design.insertion,
            physics_stands=True,
            tilt_rad=0.1,
        ),
    )
    page = comparison_page("a & b", variants)
    ET.fromstring(page.split("\n", 1)[1])
    assert "planar &lt;1&gt;" in page and "cone joints" in page
    assert "disagrees" in page and "deadlocked" in page and "1 of 2 variants stand" in page


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.5, "0.5"), (1234.5, "1234"), (-0.02, "−0.02"), (1.5e-9, "1.50·10⁻⁹"), (float("nan"), "–")],
)
def test_numbers_read_well(value: float, text: str) -> None:
    assert significant(value) == text


def test_onto_a_state_that_needs_support_a_held_trial_that_fails_disagrees_a_free_one_does_not() -> None:
    design = designed(curved=False)
    relaxed = dataclasses.replace(design, assembly=dataclasses.replace(design.assembly, goals=(Equilibrium(),)))
    data = collect(dataclasses.replace(relaxed, load_cases=()), tilts=())
    second = states(data)[1].part
    for below in ("free", "held"):
        trial = InsertionTrial(
            part=second, kind="axis", direction=(0.0, -1.0), succeeded=False, reason="pushed b0 away", below=below
        )
        entry = dataclasses.replace(inserted(second), trials=(trial,))
        told = Simulation(name="x", engine="mujoco 9", insertion=(entry,))
        found = disagreements(dataclasses.replace(data, simulation=told))
        assert [("pushed b0 away" in text) for text in found] == ([True] if below == "held" else [])


def test_films_show_recorded_motion_and_refuse_what_has_another_shape(flat: ReportData) -> None:
    placed = states(flat)[0].part
    fell = StateVerdict(placed=placed, verdict=Verdict.FELL, moved=(placed,), parts=(placed,), times=(0.0, 0.1))

    def filmed(*poses: tuple[tuple[float, ...], ...]) -> dict[str, Any]:
        told = simulated(flat.design, states=(dataclasses.replace(fell, poses=poses),))
        data = dataclasses.replace(flat, simulation=told)
        return films(data, states(data))

    found = filmed(((0.0, 0.0, 0.0),), ((0.01, 0.0, 0.2),))
    assert found == {"1": {"times": [0.0, 0.1], "parts": [1], "poses": [[[0, 0, 0]], [[0.01, 0, 0.2]]]}}
    assert filmed(((0.0, 0.0),), ((0.01, 0.2),)) == filmed(((0.0, 0.0, 0.0),)) == filmed() == {}


def test_tilts_with_friction_that_differ_are_a_disagreement_of_the_engine_that_found_them(flat: ReportData) -> None:
    critical, statics = float(np.deg2rad(20.0)), float(np.deg2rad(25.0))
    tilt = TiltVerdict(azimuth_rad=0.0, critical_rad=critical, statics_rad=statics, friction=0.5, engine="coulomb 1")
    apart = dataclasses.replace(flat, simulation=simulated(flat.design, tilt=(tilt,)))
    (said,) = disagreements(apart)
    assert said.endswith("20.00° in the friction engine, 25.00° by statics.")
    assert len(tilt_gaps(apart)) == 1
    page = report_page(apart)
    assert esc(said) in page and 'id="disagreements"' in page


def test_an_interlocking_design_is_said_to_lock_not_to_stand(solid: ReportData) -> None:
    cases = tuple(dataclasses.replace(c, case=dataclasses.replace(c.case, gravity=None)) for c in solid.after.cases)
    held = all(c.result.stands for c in cases)
    page = report_page(dataclasses.replace(solid, after=dataclasses.replace(solid.after, cases=cases)))
    assert "Does it lock?" in page and "Does it stand?" not in page
    assert (">Locks<" in page) == held


def test_figures_of_a_design_and_of_plain_parts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = Path(__file__).parents[2]
    assert main(["design", str(root / "configs" / "scarecrow.yaml"), "-o", str(tmp_path)]) == 0
    for source in (tmp_path / "design.json", root / "configs" / "scarecrow.yaml"):
        capsys.readouterr()
        folder = tmp_path / "figures"
        assert main(["export", str(source), "--format", "figures", "-o", str(folder), "--json"]) == 0
        files = [Path(f).name for f in json.loads(capsys.readouterr().out)["files"]]
        assert files == ["design.svg", "collapse.svg", "cones.svg", "film.svg", "tilt.svg"]
        stands = "stands" in (folder / "film.svg").read_text(encoding="utf-8")
        assert stands == (source.name == "design.json")


def test_the_margin_is_that_of_the_weakest_state(flat: ReportData) -> None:
    weakest = TiltReserve(critical_rad=0.02, azimuth_rad=0.0, case="load_snow", goal_rad=0.0, margin_rad=0.01)
    page = summary(dataclasses.replace(flat, reserve=weakest))
    assert "Tilts by 1.1°" in page and "under 'snow', towards right" in unescape(page)
    assert "Tilts by 1.1°" not in summary(flat)
