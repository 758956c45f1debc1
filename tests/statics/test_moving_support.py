"""How far a support may move: planks that slide off, and arches on spreading supports, against closed forms."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from physics_models import semicircle

from mocca_robot.actions import SupportMove
from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.statics.load_factor import LoadFactor
from mocca_robot.statics.moving_support import support_factors


def rectangle(low: tuple[float, float], high: tuple[float, float]) -> Polygon:
    (a, b), (c, d) = low, high
    return Polygon(np.array([[a, b], [c, b], [c, d], [a, d]]), (), 1.0)


PLANK = (
    Part("left", rectangle((1.0, 0.0), (1.2, 1.0)), fixed=True),
    Part("right", rectangle((3.0, 0.0), (3.2, 1.0)), fixed=True),
    Part("plank", rectangle((0.0, 1.0), (4.0, 1.1)), density=1000.0),
)


def moved(parts: tuple[Part, ...], friction: float = 0.0, **move: object) -> LoadFactor:
    action = SupportMove(name="move", **move)  # type: ignore[arg-type]
    (found,) = support_factors(PartsGraph.of(Assembly("m", parts, alpha_rad=None, actions=(action,))), friction)
    return found


@pytest.mark.parametrize("scale", [0.01, 1.0])
def test_a_plank_tips_off_a_support_that_moves_in_and_slides_off_one_that_moves_out(scale: float) -> None:
    """It tips where the support's outer edge passes its middle, 1.2 m in, and slides off at its end, 1 m out."""
    parts = tuple(
        Part(p.name, Polygon(scale * p.shape.exterior, (), 1.0), fixed=p.fixed)  # type: ignore[union-attr]
        for p in PLANK
    )
    for way, expected in ((-0.1, 12.0), (0.1, 10.0)):
        found = moved(parts, part="right", shift=scale * np.array([way, 0.0]))
        assert found.factor == pytest.approx(expected, rel=1e-3)
        assert found.moving == ("plank",)


def test_what_a_support_lets_down_evenly_never_falls() -> None:
    block = (
        Part("ground", rectangle((0.0, -1.0), (1.0, 0.0)), fixed=True),
        Part("block", rectangle((0.2, 0.0), (0.6, 0.5))),
    )
    found = moved(block, part="ground", shift=np.array([0.0, -0.1]))
    assert found.factor == np.inf and found.moving == ()


def test_a_block_slides_off_a_support_that_turns_at_once_without_friction_and_at_its_angle_with_it() -> None:
    block = (
        Part("ground", rectangle((-2.0, -1.0), (2.0, 0.0)), fixed=True),
        Part("block", rectangle((-0.2, 0.0), (0.2, 0.1))),
    )
    turn = {"part": "ground", "shift": np.zeros(2), "turn_rad": float(np.deg2rad(1.0))}
    assert moved(block, **turn).factor < 0.2
    assert moved(block, friction=0.3, **turn).factor == pytest.approx(np.rad2deg(np.arctan(0.3)), abs=0.1)


def spread(thickness: float, voussoirs: int) -> float:
    """Return by how much the feet of a semicircular arch may spread (mean radius 1, an even number of voussoirs).

    It opens at the crown's inner end and at the outer end of the joint where a line of thrust of least thrust leaves
    the arch first, and its halves turn about the opposite ends there. It falls when the thrust reaches the outer end of
    the springings (Ochsendorf, 2006). The hinges stay where they open.
    """
    inner, outer = 1.0 - 0.5 * thickness, 1.0 + 0.5 * thickness
    angles = np.linspace(0.0, 0.5 * np.pi, voussoirs // 2 + 1)
    spokes = np.stack([np.sin(angles), np.cos(angles)], axis=1)
    stones = [Polygon(np.array([inner * b, inner * a, outer * a, outer * b])) for a, b in itertools.pairwise(spokes)]
    areas, centres = np.array([s.volume for s in stones]), np.array([s.centroid for s in stones])
    top = np.array([0.0, outer])

    def state(gap: float, joint: int) -> tuple[float, float]:
        """Return the thrust, and by how much its moment about the springing exceeds the weights'."""
        hinge, far = inner * spokes[joint], inner * spokes[joint] + [0.5 * gap, 0.0]
        arm = top - hinge
        rise = np.sqrt(max(arm @ arm - far[0] ** 2, 0.0))
        turn = np.arctan2(rise, -far[0]) - np.arctan2(arm[1], arm[0])
        c, s = np.cos(turn), np.sin(turn)
        now = np.concatenate(
            [
                (centres[:joint] - hinge) @ np.array([[c, s], [-s, c]]) + far,
                centres[joint:] + np.array([0.5 * gap, 0.0]),
            ]
        )
        thrust = float((areas[:joint] * (far[0] - now[:joint, 0])).sum()) / rise
        return thrust, thrust * (far[1] + rise) - float((areas * (outer + 0.5 * gap - now[:, 0])).sum())

    joint = max(range(1, voussoirs // 2 + 1), key=lambda k: state(0.0, k)[0])
    low, high = 0.0, 2.0 * (float(np.linalg.norm(top - inner * spokes[joint])) - inner * spokes[joint, 0]) * 0.999
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if state(middle, joint)[1] > 0.0 else (middle, high)
    return low


@pytest.mark.parametrize(("thickness", "voussoirs"), [(0.2, 4), (0.2, 6), (0.12, 28)])
def test_an_arch_on_spreading_supports(thickness: float, voussoirs: int) -> None:
    arch = semicircle(thickness, voussoirs)
    found = moved(arch.parts, friction=3.0, part="right", shift=np.array([0.01, 0.0]))
    assert found.factor is not None
    assert 0.01 * found.factor == pytest.approx(spread(thickness, voussoirs), rel=2e-3)
    assert len(found.moving) > voussoirs // 2
