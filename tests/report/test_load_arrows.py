"""Loads in pictures: every load with its size, arrows that end where it acts, all within the picture."""

from __future__ import annotations

import re

import numpy as np
import pytest
from solids import box

from mocca_robot.actions import AddedMass, BodyAcceleration, PointForce, Pressure, SupportMove, Wind
from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report.palette import part_colours
from mocca_robot.report.pictures import Picture, draw, shared_view


def table(dimension: int) -> Assembly:
    """A slab on a block that is fixed, with loads of many kinds."""
    up = np.eye(dimension)[-1]
    ring = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    if dimension == 2:
        parts = (Part("ground", Polygon(ring), fixed=True), Part("slab", Polygon(ring * [3.0, 0.2] + [-1.0, 1.0])))
    else:
        parts = (
            Part("ground", box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), fixed=True),
            Part("slab", box((-1.0, 0.0, 1.0), (2.0, 1.0, 1.2))),
        )
    end = parts[1].shape.bounds[1]
    loads = [
        PointForce(name="person", part="slab", force=-800.0 * up, at=end),
        Pressure(name="snow", pressure_pa=1500.0, facing=up),
        Wind(name="wind", pressure_pa=500.0, towards=np.eye(dimension)[0]),
        AddedMass(name="lamp", part="slab", mass_kg=20.0),
        BodyAcceleration(name="quake", acceleration=np.eye(dimension)[0]),
    ]
    if dimension == 2:
        loads.append(SupportMove(name="settles", part="ground", shift=np.array([0.0, -0.01])))
    return Assembly("table", parts, alpha_rad=None, actions=tuple(loads))


@pytest.mark.parametrize("dimension", [2, 3])
def test_every_load_is_drawn_with_its_size_within_the_picture(dimension: int) -> None:
    graph = PartsGraph.of(table(dimension))
    view = shared_view([graph.assembly])
    svg = draw(Picture(graph=graph, colours=part_colours(graph)), view, "table")
    sizes = re.findall(r'<text class="load-size"[^>]*>([^<]*)</text>', svg)
    for size in ("person: 800 N", "snow: 1500 Pa", "wind: 500 Pa", "lamp: 20 kg", "quake: 1 m/s²"):
        assert any(size in words for words in sizes), size
    assert len(sizes) == len(graph.assembly.actions)
    arrows = re.findall(r'<g class="load"><line x1="([-\d.]+)" y1="([-\d.]+)" x2="([-\d.]+)" y2="([-\d.]+)"', svg)
    assert len(arrows) > len(sizes)
    for numbers in arrows:
        x1, y1, x2, y2 = map(float, numbers)
        assert 0.0 <= min(x1, x2) <= max(x1, x2) <= view.width and 0.0 <= min(y1, y2) <= max(y1, y2) <= view.height
    if dimension == 2:
        tip = view(graph.assembly.parts[1].shape.bounds[1])[0]
        tips = [np.fromstring(p.replace(",", " "), sep=" ")[:2] for p in re.findall(r'"load">.*?points="([^"]*)"', svg)]
        assert min(float(np.linalg.norm(p - tip)) for p in tips) < 1.0


def test_a_picture_without_loads_has_no_arrows_and_the_same_view() -> None:
    loaded = table(2)
    plain = Assembly("table", loaded.parts, alpha_rad=None)
    graph = PartsGraph.of(plain)
    svg = draw(Picture(graph=graph, colours=part_colours(graph)), shared_view([plain]), "table")
    assert "load" not in svg
    assert shared_view([plain]).scale > shared_view([loaded]).scale
