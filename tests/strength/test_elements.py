"""Finite elements against closed forms: beams, holes, notches, rods, contact; and what cannot be meshed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_estimate import beam, box

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh, Part, Polygon
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.strength import part_elements
from mocca_robot.strength.assess import assess
from mocca_robot.strength.elements import Elements, meshed
from mocca_robot.strength.mesh2d import NotMeshed, triangulated2d
from mocca_robot.strength.options import StrengthOptions
from mocca_robot.strength.part_elements import solve_part

pytest.importorskip("skfem")
STIFF, POISSON = 3e9, 0.3


def plate(ring: Array, *holes: Array, size: float, thickness: float = 1.0) -> Elements:
    points, cells = triangulated2d(Polygon(ring, holes, thickness), size)
    return Elements(points, cells, STIFF, POISSON, thickness)


def rectangle(width: float, height: float) -> Array:
    return np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])


def edge(a: Array, b: Array, count: int = 400) -> Array:
    """Return places spread evenly from a to b."""
    return a + ((np.arange(count) + 0.5) / count)[:, None] * (np.asarray(b) - a)


def pulled(elements: Elements, width: float, height: float, stress: float = 1.0) -> tuple[Array, Array]:
    """Return stresses at corners and displacements of a plate that is pulled at both ends."""
    right, left = edge(np.array([width, 0.0]), np.array([width, height])), edge(np.zeros(2), np.array([0.0, height]))
    force = np.zeros((len(right), 2))
    force[:, 0] = stress * height * elements.thickness / len(right)
    load, _ = elements.balanced(elements.at(np.concatenate([right, left]), np.concatenate([force, -force])))
    u = elements.solve(load)
    return elements.stress(u), u


def test_patch_a_constant_stress_is_exact_on_any_mesh():
    ring = np.array([[0.0, 0.0], [1.3, 0.0], [2.0, 0.0], [2.0, 1.0], [0.9, 1.0], [0.0, 1.0]])
    elements = plate(ring, size=0.23)
    stretch = np.array([[1e-3, 2e-3], [-5e-4, 3e-4]])
    u = (elements.places @ stretch.T)[np.arange(elements.basis.N), elements.axes]
    strain = 0.5 * (stretch + stretch.T)
    exact = STIFF / (1 - POISSON**2) * ((1 - POISSON) * strain + POISSON * np.trace(strain) * np.eye(2))
    np.testing.assert_allclose(elements.stress(u), np.broadcast_to(exact, (len(elements.points), 2, 2)), rtol=1e-9)
    inner = ~(np.isclose(elements.places[:, 0] % 2.0, 0.0) | np.isclose(elements.places[:, 1] % 1.0, 0.0))
    assert inner.sum() > 50
    assert np.abs((elements.matrix @ u)[inner]).max() < 1e-9 * np.abs(elements.matrix @ u).max()


def test_a_cantilever_bends_as_the_beam_does():
    length, height, force = 1.0, 0.1, 100.0
    elements = plate(rectangle(length, height), size=0.025)
    y = np.linspace(-0.5, 0.5, 801)[:-1] + 0.5 / 800
    shear = 1.5 * force * (1.0 - 4.0 * y**2) / len(y)
    tip = np.column_stack([np.full(len(y), length), (y + 0.5) * height])
    root = tip - [length, 0.0]
    bend = np.column_stack([12.0 * force * length * y / height / len(y), -shear])  # what the clamped end holds with
    down = np.column_stack([np.zeros(len(y)), shear])
    load, left = elements.balanced(elements.at(np.concatenate([tip, root]), np.concatenate([down, bend])))
    assert left < 1e-4
    u = elements.solve(load)
    stress = elements.stress(u)
    assert np.abs(stress[:, 0, 0]).max() == pytest.approx(6.0 * force * length / height**2, rel=0.02)
    energy = 0.5 * float(u @ elements.matrix @ u)
    inertia = height**3 / 12.0
    bending = force**2 * length**3 / (6.0 * STIFF * inertia)
    shearing = 0.6 * force**2 * length / (STIFF / (2 * (1 + POISSON)) * height)
    assert energy == pytest.approx(bending + shearing, rel=0.02)  # ½ F times the deflection


def test_a_plate_with_a_hole_has_three_times_the_stress():
    turn = -2.0 * np.pi * np.arange(64) / 64
    hole = 0.5 + 0.025 * np.column_stack([np.cos(turn), np.sin(turn)])
    stress, _ = pulled(plate(rectangle(1.0, 1.0), hole, size=0.08), 1.0, 1.0)
    assert np.linalg.eigvalsh(stress)[:, -1].max() == pytest.approx(3.0, rel=0.05)


def test_a_bar_with_two_round_notches_has_petersons_factor():
    height, radius = 0.2, 0.02
    turn = np.linspace(np.pi, 2.0 * np.pi, 33)[1:-1]
    top = np.column_stack([0.5 - radius * np.cos(turn + np.pi), height + radius * np.sin(turn)])[::-1]
    foot = np.column_stack([0.5 + radius * np.cos(turn), -radius * np.sin(turn)])
    ring = np.concatenate(
        [[[0, 0], [0.5 - radius, 0]], foot, [[0.5 + radius, 0], [1, 0], [1, height], [0.5 + radius, height]],
         top[np.argsort(-top[:, 0])], [[0.5 - radius, height], [0, height]]]
    )  # fmt: skip
    stress, _ = pulled(plate(ring, size=0.03), 1.0, height)
    ratio = 2.0 * radius / height  # Peterson, chart 2.4: opposite semicircular notches, by the net section
    factor = 3.065 - 3.472 * ratio + 1.009 * ratio**2 + 0.405 * ratio**3
    peak = np.linalg.eigvalsh(stress)[:, -1].max()
    assert peak * (height - 2.0 * radius) / height == pytest.approx(factor, rel=0.05)


def test_a_hanging_rod_carries_its_weight_at_the_top():
    elements = plate(rectangle(0.1, 1.0), size=0.04)
    weight = 1000.0 * 9.81
    hold = np.column_stack([np.zeros(200), np.full(200, 0.1 * weight / 200)])
    load, left = elements.balanced(
        elements.body(np.array([0.0, -weight]))
        + elements.at(edge(np.array([0.0, 1.0]), np.array([0.1, 1.0]), 200), hold)
    )
    assert left < 1e-9
    stress = elements.stress(elements.solve(load))[:, 1, 1]
    np.testing.assert_allclose(stress, weight * elements.points[:, 1], atol=0.01 * weight)


def test_smaller_elements_converge_with_second_order_at_least():
    exact, errors = None, []
    turn = np.linspace(0.0, np.pi / 2, 33)
    ring = np.concatenate([np.column_stack([np.cos(turn), np.sin(turn)]), [[0.0, 0.2]], [[0.2, 0.0]]])
    energies = []
    for size in (0.3, 0.15, 0.075, 0.03):
        elements = plate(ring, size=size)
        pull = elements.body(np.array([1.0, 0.0]))
        u = elements.solve(elements.balanced(pull * np.sin(3.0 * elements.places[:, 0]))[0])
        energies.append(float(u @ elements.matrix @ u))
    exact = energies[-1]
    errors = [abs(e - exact) / exact for e in energies[:3]]
    assert errors[0] > errors[1] > errors[2] and errors[2] < errors[0] / 8.0


def test_hertz_two_cylinders_press_with_an_ellipse():
    """Hertz's pressure on a disc: its peak at the surface, and the largest shear 0.78 half-widths below it."""
    radius, half = 1.0, 0.12
    turn = np.linspace(np.pi, 2.0 * np.pi, 161)
    ring = np.concatenate([radius * np.column_stack([np.cos(turn), np.sin(turn)]), [[radius, 0.3], [-radius, 0.3]]])
    points, cells = triangulated2d(Polygon(ring, (), 1.0), 0.12)
    elements = Elements(points, cells, STIFF, POISSON)
    x = np.linspace(-half, half, 401)[:-1] + half / 400
    push = np.sqrt(1.0 - (x / half) ** 2) * 2.0 * half / len(x)
    force = push.sum()
    foot = np.column_stack([x, -np.sqrt(radius**2 - x**2)])
    top = edge(np.array([-radius, 0.3]), np.array([radius, 0.3]))
    load, _ = elements.balanced(
        elements.at(
            np.concatenate([foot, top]),
            np.concatenate([np.column_stack([0 * push, push]), np.tile([0.0, -force / len(top)], (len(top), 1))]),
        )
    )
    stress = np.linalg.eigvalsh(elements.stress(elements.solve(load)))
    assert -stress[:, 0].min() == pytest.approx(1.0, rel=0.15)  # the peak pressure at the surface
    shear = 0.5 * (stress[:, 1] - stress[:, 0])
    below = np.abs(points[:, 0]) < 0.02
    deepest = points[below][shear[below].argmax()]
    assert -radius + 0.4 * half < deepest[1] < -radius + 1.3 * half  # largest shear below the surface: 0.78 a


def test_a_simply_supported_beam_agrees_with_the_closed_form_and_the_estimate_is_safe():
    graph = PartsGraph.of(beam())
    options = StrengthOptions(elements=1.0 / 32.0)
    by_elements = assess(graph, options, states=False, elements=solve_part)
    estimate = assess(graph, options, states=False)
    assert by_elements.parts[0].method == "elements"
    tension = next(u for u in by_elements.parts[0].uses if u.kind == "tension")
    closed = next(u for u in estimate.parts[0].uses if u.kind == "tension").stress / 2.5
    assert tension.stress == pytest.approx(closed, rel=0.05)
    assert estimate.reached < by_elements.reached


def test_solids_agree_with_plates():
    pytest.importorskip("tetgen")
    solid = Part("beam", box((0, 0, 0), (1.0, 0.1, 0.05)), 1100.0, material="plaster")
    posts = [Part(n, box((x, 0, -0.2), (x + 0.02, 0.1, 0)), fixed=True) for n, x in (("a", 0.0), ("b", 0.98))]
    found = assess(
        PartsGraph.of(Assembly("solid", (*posts, solid), alpha_rad=None)), StrengthOptions(), states=False,
        elements=solve_part,
    )  # fmt: skip
    flat = assess(PartsGraph.of(beam()), StrengthOptions(), states=False, elements=solve_part)
    assert found.parts[0].method == "elements"
    pair = [next(u.stress for u in f.parts[0].uses if u.kind == "tension") for f in (found, flat)]
    assert pair[0] == pytest.approx(pair[1], rel=0.1)


def test_a_part_that_cannot_be_meshed_is_named_and_does_not_stop_the_others(monkeypatch):
    made = beam()
    second = replace(
        made.parts[2], name="other", shape=Polygon(made.parts[2].shape.exterior + np.array([0, 0.05]), (), 0.1)
    )
    graph = PartsGraph.of(replace(made, parts=(*made.parts, second)))
    calls = []

    def fails_once(shape: Polygon | Mesh, size: float) -> tuple[Array, Array]:
        calls.append(size)
        if len(calls) == 1:
            raise NotMeshed("it is a knot")
        return meshed(shape, size)

    monkeypatch.setattr(part_elements, "meshed", fails_once)
    found = assess(graph, StrengthOptions(), states=False, elements=solve_part)
    assert [p.method for p in found.parts] == ["estimate", "elements"]
    assert found.parts[0].why == "it is a knot" and found.parts[0].uses
