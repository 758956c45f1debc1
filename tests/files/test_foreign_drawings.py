"""Drawings as Inkscape, Illustrator, Figma, Affinity and CAD write them: the same two parts by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest

from mocca_robot.errors import InputError
from mocca_robot.files.drawing import Drawing
from mocca_robot.files.dxf import read_dxf
from mocca_robot.files.svg import read_svg

SEEDS = range(20)
GROUND = np.array([[0, 80], [100, 80], [100, 100], [0, 100]], dtype=float)
STONE = np.array([[20, 40], [60, 40], [60, 80], [20, 80]], dtype=float)
NAMES = ("http://www.w3.org/2000/svg", "http://www.inkscape.org/namespaces/inkscape", "http://www.serif.com/")


Points = np.ndarray[Any, np.dtype[np.float64]]


class Pen:
    """Draws outlines in one of many ways, drawn from a seed."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.scale = float(10 ** self.rng.uniform(-2, 2))

    def ring(self, corners: Points) -> Points:
        turned = corners if self.rng.random() < 0.5 else corners[::-1]
        return np.roll(turned, self.rng.integers(len(corners)), axis=0) * self.scale

    def path(self, corners: Points, gap: float = 0.0) -> str:
        ring = self.ring(corners)
        text = "M " + " L ".join(f"{x!r} {y!r}" for x, y in ring.tolist())
        if not gap:
            return text + " Z"
        x, y = (ring[0] + gap * self.scale).tolist()
        return f"{text} L {x!r} {y!r}"

    def lines(self, corners: Points) -> str:
        ring = self.ring(corners).tolist()
        sides = [(a, b) if self.rng.random() < 0.5 else (b, a) for a, b in zip(ring, ring[1:] + ring[:1])]
        out = [f'<line x1="{a[0]!r}" y1="{a[1]!r}" x2="{b[0]!r}" y2="{b[1]!r}"/>' for a, b in sides]
        return "".join(out[k] for k in self.rng.permutation(len(out)))


def inkscape(pen: Pen) -> str:
    number = int(pen.rng.integers(1000, 9999))
    return (
        f'<g inkscape:groupmode="layer" id="layer1" inkscape:label="Layer 1">'
        f'<path id="path{number}" inkscape:label="ground" d="{pen.path(GROUND)}"/>'
        f'<path id="path{number + 1}-7-2" inkscape:label="stone" d="{pen.path(STONE)}"/></g>'
    )


def illustrator(pen: Pen) -> str:
    return (
        f'<style type="text/css">.st0{{fill:#D9D9D9;}}</style><g id="ground"><path class="st0" d="{pen.path(GROUND)}"/>'
        f'</g><g id="st_x6F_ne"><g><path class="st0" d="{pen.path(STONE)}"/></g></g>'
    )


def figma(pen: Pen) -> str:
    side = 100 * pen.scale
    return (
        f'<g id="Frame 1" clip-path="url(#c)"><rect width="{side!r}" height="{side!r}" fill="white"/>'
        f'<path id="ground" d="{pen.path(GROUND)}"/><path id="stone" d="{pen.path(STONE)}"/></g>'
        f'<defs><clipPath id="c"><rect width="{side!r}" height="{side!r}"/></clipPath></defs>'
    )


def affinity(pen: Pen) -> str:
    return (
        f'<g id="ground1" serif:id="ground"><path d="{pen.path(GROUND)}"/></g>'
        f'<path id="stone2" serif:id="stone" d="{pen.path(STONE)}"/>'
    )


def styled(pen: Pen) -> str:
    x, y = pen.rng.uniform(-50, 50, 2)
    shift = np.array([x, y])
    unit = ("px", 1.0) if pen.rng.random() < 0.5 else ("mm", 96 / 25.4)
    mx, my = (float(v * pen.scale / unit[1]) for v in (x, y))
    move = f"transform: translate({mx!r}{unit[0]}, {my!r}{unit[0]})"
    return (
        f'<style>.away {{ {move} }}</style><path id="ground" class="away" d="{pen.path(GROUND - shift)}"/>'
        f'<path id="stone" style="fill:red; {move} rotate(1turn)" d="{pen.path(STONE - shift)}"/>'
    )


def single_lines(pen: Pen) -> str:
    return f'<g id="ground">{pen.lines(GROUND)}</g><g id="stone">{pen.lines(STONE)}</g>'


def gaps(pen: Pen) -> str:
    gap = 10 ** pen.rng.uniform(-6, -2.7)
    return f'<path id="ground" d="{pen.path(GROUND, gap)}"/><path id="stone" d="{pen.path(STONE, -gap)}"/>'


def svg(folder: Path, pen: Pen, body: str) -> Path:
    side = 100 * pen.scale
    spaces = f'xmlns="{NAMES[0]}" xmlns:inkscape="{NAMES[1]}" xmlns:serif="{NAMES[2]}"'
    path = folder / "drawing.svg"
    path.write_text(
        f'<svg {spaces} width="{side!r}mm" height="{side!r}mm" viewBox="0 0 {side!r} {side!r}">{body}</svg>',
        encoding="utf-8",
    )
    return path


def assert_both(read: Drawing, scale: float, names: tuple[str, ...] = ("ground", "stone")) -> None:
    parts = dict(read.parts)
    assert tuple(sorted(parts)) == names
    areas = [parts[n].area_moments[0] * 1e6 / scale**2 for n in names]
    assert areas == pytest.approx([2000, 1600], rel=1e-3)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("draw", [inkscape, illustrator, figma, affinity, styled, single_lines, gaps])
def test_what_editors_write_is_understood(tmp_path: Path, draw: Callable[[Pen], str], seed: int) -> None:
    pen = Pen(seed)
    read = read_svg(svg(tmp_path, pen, draw(pen)))
    assert_both(read, pen.scale)
    if draw is figma:
        assert any("background" in n for n in read.notes)
    if draw is gaps:
        assert all("gap of" in n for n in read.notes)


def test_names_used_twice_are_numbered_and_said(tmp_path: Path) -> None:
    pen = Pen(0)
    body = f'<path id="path1" inkscape:label="a" d="{pen.path(GROUND)}"/><path id="a" d="{pen.path(STONE)}"/>'
    read = read_svg(svg(tmp_path, pen, body))
    assert_both(read, pen.scale, ("a_1", "a_2"))
    assert any("2 parts are called 'a'" in n for n in read.notes)


@pytest.mark.parametrize("style", ["rotate3d(1,1,1,45deg)", "translate(10%, 0)", "perspective(3px)", "nonsense"])
def test_a_style_that_cannot_be_applied_is_said(tmp_path: Path, style: str) -> None:
    pen = Pen(1)
    body = f'<path id="stone" style="transform: {style}" d="{pen.path(STONE)}"/>'
    with pytest.raises(InputError, match=r"'stone' has the transform .* in the editor"):
        read_svg(svg(tmp_path, pen, body))


def dxf(folder: Path, draw: Callable[[Any], object]) -> Path:
    document = ezdxf.new("R2010", units=4)
    draw(document)
    document.saveas(folder / "drawing.dxf")
    return folder / "drawing.dxf"


@pytest.mark.parametrize("seed", SEEDS)
def test_blocks_inside_blocks_keep_their_names(tmp_path: Path, seed: int) -> None:
    pen = Pen(seed)

    def draw(document: Any) -> None:
        for name, corners in (("ground", GROUND), ("stone", STONE)):
            document.blocks.new(name).add_lwpolyline(pen.ring(corners).tolist(), close=True)
        outer = document.blocks.new("ASSEMBLY")
        order = ["ground", "stone"] if seed % 2 else ["stone", "ground"]
        for name in order:
            outer.add_blockref(name, (0, 0))
        document.modelspace().add_blockref("ASSEMBLY", tuple(pen.rng.uniform(-9, 9, 2) * pen.scale))

    assert_both(read_dxf(dxf(tmp_path, draw)), pen.scale)


@pytest.mark.parametrize("seed", SEEDS)
def test_lines_that_share_edges_bound_parts(tmp_path: Path, seed: int) -> None:
    pen = Pen(seed)

    def draw(document: Any) -> None:
        # The stone's foot lies on the ground's upper edge, which is one line.
        sides = [(GROUND[k], GROUND[(k + 1) % 4]) for k in range(4)] + [(STONE[k], STONE[k + 1]) for k in (0, 1)]
        sides.append((STONE[3], STONE[0]))
        for k in pen.rng.permutation(len(sides)):
            a, b = sides[k] if pen.rng.random() < 0.5 else sides[k][::-1]
            jitter = pen.rng.uniform(-1, 1, (2, 2)) * 1e-5
            a, b = (np.array([a, b]) + jitter) * pen.scale
            document.modelspace().add_line(tuple(a), tuple(b), dxfattribs={"layer": "all"})
        for name, corners in (("ground", GROUND), ("stone", STONE)):
            document.modelspace().add_text(name, dxfattribs={"insert": tuple(corners.mean(axis=0) * pen.scale)})

    read = read_dxf(dxf(tmp_path, draw))
    assert_both(read, pen.scale)
    assert any("network" in n for n in read.notes)
