"""The tangent frame: unit, across, right-handed, one by one as in a batch, in 2D and in 3D."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocca_robot.arrays import Array
from mocca_robot.geometry.frames import tangents

AXES = [*np.eye(3), *-np.eye(3)]


@st.composite
def directions(draw: st.DrawFn) -> Array:
    """A unit vector in 3D, often with components that are zero or equal."""
    raw = draw(st.tuples(*[st.one_of(st.sampled_from([0.0, 1.0, -1.0, 1e-9]), st.floats(-1, 1))] * 3).filter(any))
    scaled = np.array(raw) / np.abs(raw).max()
    return np.asarray(scaled / np.linalg.norm(scaled))


def assert_frame(direction: Array, across: Array) -> None:
    assert across @ across.T == pytest.approx(np.eye(2), abs=1e-12)
    assert across @ direction == pytest.approx([0.0, 0.0], abs=1e-12)
    assert np.cross(*across) == pytest.approx(direction, abs=1e-12)


@given(directions())
def test_in_space_the_frame_is_right_handed(direction: Array) -> None:
    assert_frame(direction, tangents(direction))
    assert_frame(direction, -tangents(direction))


@pytest.mark.parametrize("direction", AXES, ids=str)
def test_axes_have_frames_of_axes(direction: Array) -> None:
    across = tangents(direction)
    assert_frame(direction, across)
    assert np.count_nonzero(across) == 2


@given(st.lists(directions(), min_size=1, max_size=5))
def test_a_batch_gives_what_each_gives(many: list[Array]) -> None:
    batch = tangents(np.array(many))
    assert batch.shape == (len(many), 2, 3)
    assert batch == pytest.approx(np.array([tangents(d) for d in many]), abs=1e-15)
    assert tangents(np.array(many)[None]).tolist() == [batch.tolist()]


def test_in_the_plane_it_is_a_quarter_turn_to_the_left() -> None:
    assert tangents(np.array([1.0, 0.0])).tolist() == [[0.0, 1.0]]
    assert tangents(np.array([[0.6, 0.8], [0.0, -1.0]])).tolist() == [[[-0.8, 0.6]], [[1.0, 0.0]]]
