"""Arm kinematics against closed forms and finite differences; poses against the algebra of rotations."""

from __future__ import annotations

import numpy as np
import pytest

from mocca_robot.errors import InputError
from mocca_robot.plan.arm_models import MODELS, robot_model
from mocca_robot.plan.pose import angle_rad, pose_of, rotation_matrix, rotation_vector, transform

TOOL = (0.01, -0.02, 0.15, 0.1, 0.2, -0.3)


@pytest.mark.parametrize("name", sorted(MODELS))
def test_arm_at_zero_lies_where_its_lengths_say(name: str) -> None:
    m = MODELS[name]
    flange = m.tcp_matrix(np.zeros(6))[:3, 3]
    assert flange == pytest.approx([m.a[1] + m.a[2], -(m.d[3] + m.d[5]), m.d[0] - m.d[4]], abs=1e-12)


@pytest.mark.parametrize("name", sorted(MODELS))
def test_jacobian_is_the_derivative_of_the_pose(name: str) -> None:
    m, rng, h = MODELS[name], np.random.default_rng(3), 1e-6
    for q in rng.uniform(-3, 3, (5, 6)):
        jacobian = m.jacobian(q, TOOL)
        for j, e in enumerate(np.eye(6)):
            after, before = m.tcp_matrix(q + h * e, TOOL), m.tcp_matrix(q - h * e, TOOL)
            turning = rotation_vector(after[:3, :3] @ before[:3, :3].T) / (2 * h)
            assert jacobian[:3, j] == pytest.approx((after[:3, 3] - before[:3, 3]) / (2 * h), abs=1e-6)
            assert jacobian[3:, j] == pytest.approx(turning, abs=1e-6)


@pytest.mark.parametrize("name", sorted(MODELS))
def test_solved_joints_reach_the_pose(name: str) -> None:
    m, rng = MODELS[name], np.random.default_rng(4)
    for q in rng.uniform(-1, 1, (5, 6)) + np.array([0, -1.5, 1.5, -1.5, -1.5, 0]):
        solved = m.solve_pose(m.tcp_pose(q, TOOL), q + rng.uniform(-0.05, 0.05, 6), TOOL)
        assert m.tcp_matrix(solved, TOOL) == pytest.approx(m.tcp_matrix(q, TOOL), abs=2e-6)


def test_pose_out_of_reach_is_refused_with_the_distance_left() -> None:
    with pytest.raises(InputError, match=r"ur5e.*mm remain.*0\.85 m"):
        robot_model("ur5e").solve_pose((2.0, 0, 0, 0, 0, 0), np.full(6, 0.3))


def test_unknown_model_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(InputError, match="did you mean 'ur5e'"):
        robot_model("ur5")


def test_rotation_vectors_survive_the_round_trip_up_to_half_a_turn() -> None:
    rng = np.random.default_rng(5)
    for angle in (0.0, 1e-9, 1e-4, 1.0, 3.0, np.pi - 1e-5, np.pi - 1e-9, np.pi):
        for axis in rng.normal(size=(8, 3)):
            rotation = rotation_matrix(axis / np.linalg.norm(axis) * angle)
            assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
            assert rotation_matrix(rotation_vector(rotation)) == pytest.approx(rotation, abs=1e-7)


def test_angle_between_poses_is_that_of_their_relative_rotation() -> None:
    a = (0.1, 0.2, 0.3, 0.4, -0.5, 0.6)
    b = pose_of(transform(a) @ transform((0, 0, 0, 0, 0.25, 0)))
    assert angle_rad(a, b) == pytest.approx(0.25, abs=1e-9)


@pytest.mark.parametrize(("new", "known"), [("ur7e", "ur5e"), ("ur12e", "ur10e")])
def test_arms_of_the_same_size_move_alike_and_are_rehearsed_alike(new: str, known: str) -> None:
    from sim.cell.arm_model import JOINT_TORQUE_NM, LINK_MASS_KG

    a, b = MODELS[new], MODELS[known]
    assert (a.d, a.a, a.dashboard_name) == (b.d, b.a, b.dashboard_name) and a.payload_kg >= b.payload_kg
    assert LINK_MASS_KG[new] == LINK_MASS_KG[known] and set(MODELS) == set(LINK_MASS_KG) == set(JOINT_TORQUE_NM)
