"""Joints of a design read from its files: the same curves and patches again, or why they cannot be shown."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from solids import box

from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.contacts.find import find_contacts
from mocca_robot.design import Design
from mocca_robot.errors import InputError
from mocca_robot.files.design_json import StoredDesign, read_design, write_design
from mocca_robot.files.stored_joints import joints_of
from mocca_robot.joints.bicubic import bicubic_joint
from mocca_robot.joints.build import build_parts
from mocca_robot.joints.joint import Joint, planar
from mocca_robot.joints.options import JointOptions
from mocca_robot.joints.rectangle import largest_rectangle
from mocca_robot.joints.tenon import tenon_joint, tenon_joint_2d
from planners.cone_joints.shapes2d import Shapes2D

KINDS = {
    2: ("planar", "n", "z", "piecewise_n", "piecewise_z", "tenon"),
    3: ("planar", "bicubic", "bicubic_z", "piecewise", "piecewise_z", "tenon"),
}


def flat_source() -> Assembly:
    """Return a U and a block in it that touch three times: several contacts of one pair."""
    u = [[0, 0], [0.3, 0], [0.3, 0.2], [0.2, 0.2], [0.2, 0.1], [0.1, 0.1], [0.1, 0.2], [0, 0.2]]
    block = [[0.1, 0.1], [0.2, 0.1], [0.2, 0.3], [0.1, 0.3]]
    shapes = [Polygon(np.array(points, dtype=float), (), 0.02) for points in (u, block)]
    return Assembly("cup", (Part("cup", shapes[0], fixed=True), Part("block", shapes[1])))


def solid_source() -> Assembly:
    parts = (
        Part("base", box((0, 0, 0), (1, 1, 1)), fixed=True),
        Part("left", box((0, 0, 1), (0.5, 1, 2))),
        Part("right", box((0.5, 0, 1), (1, 1, 2))),
    )
    return Assembly("pile", parts)


def designed(dimension: int, kind: str) -> Design:
    """Return a design whose every joint is of `kind`, u leaning a little."""
    source = flat_source() if dimension == 2 else solid_source()
    contacts = find_contacts(source).contacts
    joints: list[Joint] = []
    shapes = None
    if dimension == 2:
        options = JointOptions(piecewise_planar=kind.startswith("piecewise"))
        shapes = Shapes2D.of(source, contacts, options).with_kinds(["z" if kind.endswith("z") else "n"] * len(contacts))
    for k, contact in enumerate(contacts):
        if kind == "planar":
            joints.append(planar(contact))
        elif shapes is not None:
            normal = contact.normal
            u = np.array(
                [np.cos(0.1) * normal[0] - np.sin(0.1) * normal[1], np.sin(0.1) * normal[0] + np.cos(0.1) * normal[1]]
            )
            if kind == "tenon":
                joints.append(tenon_joint_2d(contact, u, 0.3, 0.7, 0.004))
            else:
                joints.append(shapes.joint(k, np.array([0.15, 0.2, 0.05 + 0.01 * k, -0.04]), u))
        else:
            rectangle = largest_rectangle(contact, 0.05)
            assert rectangle is not None
            u = contact.normal + 0.1 * rectangle.axis_x
            if kind == "tenon":
                joints.append(tenon_joint(contact, rectangle, 0.03, u, 0.05))
            else:
                segments = 1 if kind.startswith("piecewise") else 3
                part = rectangle.part((0.1, 0.1), (0.9, 0.9))
                joints.append(bicubic_joint(contact, part, 0.02, u, segments, "z" if kind.endswith("_z") else "n"))
    assert {j.kind for j in joints} == {kind}
    return Design(
        source=source, assembly=build_parts(source, joints), joints=tuple(joints), insertion=(), load_cases=()
    )


@pytest.mark.parametrize(("dimension", "kind"), [(d, k) for d, kinds in KINDS.items() for k in kinds])
def test_every_kind_comes_back_as_it_was_built(dimension: int, kind: str, tmp_path: Path) -> None:
    design = designed(dimension, kind)
    stored = read_design(write_design(design, tmp_path))
    assert stored.source is not None
    back = joints_of(stored, find_contacts(stored.source).contacts)
    assert len(back) == len(design.joints) == 3
    for mine, again in zip(design.joints, back):
        assert again.kind == mine.kind and again.contact.parts == mine.contact.parts
        assert again.parameters == mine.parameters
        np.testing.assert_allclose(again.vertices, mine.vertices, atol=1e-12)
        np.testing.assert_array_equal(again.facets, mine.facets)


def altered(stored: StoredDesign, **changes: object) -> StoredDesign:
    """Return `stored` with its first joint changed."""
    first = replace(stored.joints[0], **changes)  # type: ignore[arg-type]
    return replace(stored, joints=(first, *stored.joints[1:]))


@pytest.mark.parametrize("dimension", [2, 3])
def test_altered_files_are_told_apart(dimension: int, tmp_path: Path) -> None:
    stored = read_design(write_design(designed(dimension, "n" if dimension == 2 else "bicubic"), tmp_path))
    assert stored.source is not None
    contacts = find_contacts(stored.source).contacts
    numbers = dict(stored.joints[0].parameters)
    height = "h" if dimension == 2 else "height_m"
    refused = [
        (altered(stored, kind="zigzag"), "unknown type 'zigzag'"),
        (altered(stored, parameters={k: v for k, v in numbers.items() if k != height}), height),
        (altered(stored, parameters={**numbers, height: 1.5 * numbers[height]}), "not what lies between"),
        (altered(stored, parts=stored.joints[0].parts[::-1]), "no contact of its own"),
        (replace(stored, joints=(*stored.joints, stored.joints[0])), "no contact of its own"),
        (replace(stored, source=None), "as they were handed in"),
    ]
    if dimension == 3:
        refused.append((altered(stored, parameters={**numbers, "l1_m": 0.0}), "sides of 0 m"))
        refused.append((altered(stored, parameters={**numbers, "flank_segments": 1e9}), "pieces per flank"))
    for broken, words in refused:
        with pytest.raises(InputError, match=words):
            joints_of(broken, contacts)
    assert joints_of(replace(stored, joints=(), source=None), contacts) == ()


def test_a_report_made_from_the_files_alone_shows_the_joints(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_design(designed(2, "z"), tmp_path)
    main(["simulate", str(tmp_path), "--states", "--json"])
    assert json.loads(capsys.readouterr().out)["curved_joints"] == 3
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    table = page[page.index('<section id="joints">') :].partition("</section>")[0]
    assert table.count("<td>z</td>") == 3 and "<svg" in table
    data = json.loads((tmp_path / "design.json").read_text(encoding="utf-8"))
    data["joints"][0]["parameters"]["h1"] *= 2.0
    (tmp_path / "design.json").write_text(json.dumps(data), encoding="utf-8")
    main(["simulate", str(tmp_path), "--states", "--json"])
    (note,) = [n for n in json.loads(capsys.readouterr().out)["notes"] if n.startswith("No joints are shown")]
    assert "cup – block" in note and "Design again" in note
