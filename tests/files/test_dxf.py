"""DXF drawings: whatever outlines are made of, the part is the same; names, units and what is wrong are told."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.config.config import load
from mocca_robot.contacts.find import find_contacts, require_sound
from mocca_robot.errors import InputError
from mocca_robot.fabrication.cut import write_cut_dxf
from mocca_robot.files.drawing import Drawing
from mocca_robot.files.dxf import read_dxf

RECTANGLE = [(10.0, 5.0), (30.0, 5.0), (30.0, 20.0), (10.0, 20.0)]


def drawing(folder: Path, draw: Callable[[Any], object], units: int = 4) -> Path:
    document = ezdxf.new("R2010", units=units)
    draw(document)
    path = folder / "drawing.dxf"
    document.saveas(path)
    return path


def parts(read: Drawing) -> dict[str, Polygon]:
    return dict(read.parts)


def lines(document: Any, layer: str, points: list[tuple[float, float]], turned: bool = False) -> None:
    for k, a in enumerate(points):
        b = points[(k + 1) % len(points)]
        document.modelspace().add_line(*((b, a) if turned and k % 2 else (a, b)), dxfattribs={"layer": layer})


def polyline(document: Any, layer: str, points: list[tuple[float, float]]) -> None:
    document.modelspace().add_lwpolyline(points, close=True, dxfattribs={"layer": layer})


def block(document: Any) -> None:
    inside = document.blocks.new("a")
    inside.add_lwpolyline([(0, 0), (15, 0), (15, 20), (0, 20)], close=True)
    document.modelspace().add_blockref("a", (30, 5), dxfattribs={"rotation": 90})


def old_polyline(document: Any) -> None:
    document.modelspace().add_polyline2d(RECTANGLE, close=True, dxfattribs={"layer": "a"})


@pytest.mark.parametrize(
    "draw",
    [
        lambda d: polyline(d, "a", RECTANGLE),
        lambda d: polyline(d, "a", RECTANGLE[::-1]),
        lambda d: lines(d, "a", RECTANGLE),
        lambda d: lines(d, "A"[0].lower(), RECTANGLE, turned=True),
        lambda d: d.modelspace().add_lwpolyline([*RECTANGLE, RECTANGLE[0]], dxfattribs={"layer": "a"}),
        old_polyline,
        block,
    ],
    ids=["polyline", "reversed", "lines", "lines turned", "ends meet", "old polyline", "block turned"],
)
def test_every_way_to_draw_a_rectangle_is_the_same_part(tmp_path: Path, draw: Callable[[Any], object]) -> None:
    ((name, shape),) = read_dxf(drawing(tmp_path, draw)).parts
    assert name == "a"
    corners = {tuple(p) for p in np.round(shape.exterior * 1e3, 6).tolist()}
    assert corners == set(RECTANGLE)


def test_arcs_circles_ellipses_and_splines_keep_their_areas(tmp_path: Path) -> None:
    def draw(document: Any) -> None:
        space = document.modelspace()
        space.add_circle((50, 50), 20, dxfattribs={"layer": "ring"})
        space.add_circle((50, 50), 10, dxfattribs={"layer": "ring"})
        space.add_ellipse((150, 50), (30, 0), 0.5, dxfattribs={"layer": "egg"})
        space.add_lwpolyline([(200, 0, 0), (240, 0, 1), (240, 40, 0), (200, 40, 1)], format="xyb", close=True,
                             dxfattribs={"layer": "stadium"})  # fmt: skip
        space.add_arc((300, 0), 20, 0, 180, dxfattribs={"layer": "half"})
        space.add_line((280, 0), (320, 0), dxfattribs={"layer": "half"})
        around = [(400 + 20 * np.cos(t), 20 * np.sin(t), 0) for t in np.linspace(0, 2 * np.pi, 33)]
        space.add_spline(around, dxfattribs={"layer": "loop"})

    found = parts(read_dxf(drawing(tmp_path, draw)))
    area = {name: p.volume / p.thickness * 1e6 for name, p in found.items()}
    assert area["ring"] == pytest.approx(np.pi * 300, rel=1e-2)
    assert len(found["ring"].holes) == 1
    assert area["egg"] == pytest.approx(np.pi * 30 * 15, rel=1e-2)
    assert area["stadium"] == pytest.approx(1600 + np.pi * 400, rel=1e-2)
    assert area["half"] == pytest.approx(np.pi * 200, rel=1e-2)
    assert area["loop"] == pytest.approx(np.pi * 400, rel=1e-2)


def test_parts_are_named_by_block_text_or_layer(tmp_path: Path) -> None:
    def draw(document: Any) -> None:
        space = document.modelspace()
        key = document.blocks.new("key")
        key.add_lwpolyline([(0, 0), (9, 0), (9, 9), (0, 9)], close=True)
        for x in (0, 20):
            space.add_blockref("key", (x, 0))
        for k, x in enumerate((100, 120, 140)):
            polyline(document, "CUT", [(x, 0), (x + 9, 0), (x + 9, 9), (x, 9)])
            if k == 1:
                space.add_text("middle  stone", dxfattribs={"layer": "ENGRAVE"}).set_placement((x + 3, 4))
        polyline(document, "0", [(200, 0), (209, 0), (209, 9)])
        polyline(document, "wall", [(300, 0), (309, 0), (309, 9)])
        space.add_mtext("west\\Pwall", dxfattribs={"insert": (307, 2)})

    assert set(parts(read_dxf(drawing(tmp_path, draw)))) == {
        "key_1",
        "key_2",
        "CUT_1",
        "CUT_2",
        "middle stone",
        "part",
        "west wall",
    }


def test_neighbours_share_their_arc_whoever_draws_it(tmp_path: Path) -> None:
    def draw(document: Any) -> None:
        space = document.modelspace()
        space.add_lwpolyline([(0, 0), (100, 0), (100, 40, 0, 0, 0.3), (0, 40)], close=True, format="xyseb",
                             dxfattribs={"layer": "ground"})  # fmt: skip
        space.add_lwpolyline([(0, 40, -0.3), (100, 40, 0), (100, 90, 0), (0, 90, 0)], close=True, format="xyb",
                             dxfattribs={"layer": "block"})  # fmt: skip

    path = drawing(tmp_path, draw)
    assembly = load(path, {"fixed": ["ground"]}).assembly
    report = find_contacts(assembly)
    require_sound(assembly, report)
    assert len(report.contacts) > 3
    assert main(["check", str(path), "--set", "fixed=ground"]) in (0, 1)


@pytest.mark.parametrize(("number", "unit_m"), [(1, 0.0254), (2, 0.3048), (4, 1e-3), (5, 1e-2), (6, 1.0), (13, 1e-6)])
def test_units_come_from_the_drawing(tmp_path: Path, number: int, unit_m: float) -> None:
    read = read_dxf(drawing(tmp_path, lambda d: polyline(d, "a", RECTANGLE), number))
    assert read.unit_m == unit_m
    assert read.parts[0][1].exterior.max() == pytest.approx(30 * unit_m)


def test_units_may_come_from_the_user_but_not_contradict(tmp_path: Path) -> None:
    silent = drawing(tmp_path, lambda d: polyline(d, "a", RECTANGLE), 0)
    with pytest.raises(InputError, match=r"has no unit \(\$INSUNITS\).*units: mm"):
        read_dxf(silent)
    assert read_dxf(silent, "cm").unit_m == 0.01
    with pytest.raises(InputError, match="the unit number 3"):
        read_dxf(drawing(tmp_path, lambda d: polyline(d, "a", RECTANGLE), 3))
    with pytest.raises(InputError, match=r"its unit is mm .*units: in"):
        read_dxf(drawing(tmp_path, lambda d: polyline(d, "a", RECTANGLE)), "in")


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    def draw(document: Any) -> None:
        polyline(document, "a", RECTANGLE)
        document.layers.add("off").off()
        polyline(document, "off", RECTANGLE)
        document.modelspace().add_point((1, 1))

    read = read_dxf(drawing(tmp_path, draw))
    assert list(parts(read)) == ["a"]
    assert any("1 POINT left out" in n for n in read.notes) and any("1 hidden element" in n for n in read.notes)


def _open(d: Any) -> None:
    d.modelspace().add_lwpolyline(RECTANGLE, dxfattribs={"layer": "gap"})


def _crossing(d: Any) -> None:
    polyline(d, "bow", [(0, 0), (10, 10), (10, 0), (0, 10)])


def _steep(d: Any) -> None:
    d.modelspace().add_polyline3d([(0, 0, 0), (10, 0, 5), (10, 10, 0)], close=True, dxfattribs={"layer": "roof"})


def _in_itself(d: Any) -> None:
    first = d.blocks.new("loop")
    first.add_blockref("loop", (1, 1))
    d.modelspace().add_blockref("loop", (0, 0))


def _array(d: Any) -> None:
    d.blocks.new("tile").add_lwpolyline(RECTANGLE, close=True)
    d.modelspace().add_blockref("tile", (0, 0), dxfattribs={"row_count": 1000, "column_count": 1000, "row_spacing": 9})


def _doubling(d: Any) -> None:
    d.blocks.new("b0").add_lwpolyline(RECTANGLE, close=True)
    for k in range(1, 10):
        for _ in range(8):
            d.blocks.get(f"b{k}") or d.blocks.new(f"b{k}")
            d.blocks.get(f"b{k}").add_blockref(f"b{k - 1}", (0, 0))
    d.modelspace().add_blockref("b9", (0, 0))


@pytest.mark.parametrize(
    ("draw", "said"),
    [
        (_open, r"'gap' is not closed at \((10, 5|10, 20)\) mm"),
        (_crossing, "'bow'.*crosses or touches itself"),
        (_steep, "'roof' is not flat: its heights run from 0 to 5"),
        (_in_itself, "blocks inside blocks more than 10 deep|more than 50,000"),
        (_array, "'tile' is inserted as an array; explode it"),
        (_doubling, "more than 50,000 elements"),
        (lambda d: None, "holds no visible closed path"),
    ],
    ids=["open", "crossing", "steep", "block in itself", "array", "blocks doubled", "empty"],
)
def test_unusable_drawings_are_refused_with_the_place(tmp_path: Path, draw: Callable[[Any], object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_dxf(drawing(tmp_path, draw))


@pytest.mark.parametrize("content", [b"", b"0\nSECTION\n", b"AC1032" + bytes(500), b"\x00" * 100, b"<svg/>"])
def test_what_is_no_dxf_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.dxf"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"no DXF|cannot be read as DXF|no unit"):
        read_dxf(path)


def test_the_sheet_that_is_written_comes_back_by_name(tmp_path: Path) -> None:
    square = np.array([[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1]])
    hole = np.array([[0.03, 0.03], [0.03, 0.06], [0.06, 0.06], [0.06, 0.03]])
    flat = Assembly("s", (Part("ground stone", Polygon(square, (hole,), 0.01), fixed=True),
                          Part("b", Polygon(np.add(square, [0, 0.1]), (), 0.01))))  # fmt: skip
    read = parts(read_dxf(write_cut_dxf(flat, tmp_path / "a.dxf")))
    assert {n: p.volume for n, p in read.items()} == pytest.approx({p.name: p.shape.volume * (
        read[p.name].thickness / 0.01) for p in flat.parts}, rel=1e-6)  # fmt: skip


def test_a_dxf_is_designed_like_any_drawing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def draw(document: Any) -> None:
        polyline(document, "ground", [(0, 0), (200, 0), (200, 20), (0, 20)])
        polyline(document, "block", [(50, 20), (150, 20), (150, 60), (50, 60)])

    path = drawing(tmp_path, draw)
    assert main(["new", "pair", "--from", str(path), "-o", str(tmp_path)]) == 0
    assert main(["run", str(tmp_path / "pair.yaml"), "-o", str(tmp_path / "out")]) == 0
    assert "2 parts" in capsys.readouterr().out
