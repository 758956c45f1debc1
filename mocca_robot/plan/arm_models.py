"""The Universal Robots arms this driver knows: kinematics, joint limits, reach and payload.

Figures as published by Universal Robots: "DH parameters for calculations of kinematics and dynamics" (support
article) and the arms' technical data sheets. A real arm differs by millimetres, up to a centimetre: `calibration` fits
a plan to what the factory measured. The UR7e and the UR12e are a UR5e and a UR10e of the same size that may carry more
or have another name (Universal Robots' own description for ROS 2 has the same figures for both), and their controllers
give the older names. UR8 Long, UR15 and UR18 are not here: their link lengths were not to be had from the maker.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.errors import InputError, nearest
from mocca_robot.plan.pose import Six, pose_of, rotation_vector, transform
from mocca_robot.tolerances import EXACT

REACHED = 1e-6
"""Of inverse kinematics, m and rad: a hundredth of what an arm repeats."""
DAMPING = 1e-4
"""Of the least-squares step, per metre of error: singular poses slow it down, and do not stop it."""

_ALPHA: Six = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
_TURN = 2.0 * np.pi


@dataclass(frozen=True, kw_only=True)
class RobotModel:
    """One arm.

    Attributes:
        name: as plans and configurations spell it.
        dashboard_name: what the controller answers to `get robot model`.
        d, a: Denavit–Hartenberg offsets and lengths, metres, six each.
        theta, alpha: its angles: zeros of the joints and twists of the links; a model's unless an arm is calibrated.
        joint_limit_rad: largest |q| per joint.
        joint_speed_rad_s: largest |dq/dt| per joint.
        reach_m: published reach, from the base's axis.
        payload_kg: published payload, gripper included.
        contact_force_n: force that counts as contact unless a cell says otherwise: larger arms have coarser sensors. A
            starting point, unproven.
    """

    name: str
    dashboard_name: str
    d: Six
    a: Six
    joint_speed_rad_s: Six
    reach_m: float
    payload_kg: float
    contact_force_n: float = 5.0
    theta: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    alpha: Six = _ALPHA
    joint_limit_rad: Six = (_TURN, _TURN, _TURN, _TURN, _TURN, _TURN)

    def frames(self, q: Sequence[float] | Array) -> list[Array]:
        """Return the base frame and the frames after each joint, seven matrices (…, 4, 4); the last is the flange.

        `q` is (6,) or (…, 6) for many configurations at once.
        """
        angles = np.asarray(q, dtype=np.float64) + np.asarray(self.theta)
        out = [np.eye(4)]
        for k, (d, a, alpha) in enumerate(zip(self.d, self.a, self.alpha, strict=True)):
            ct, st, ca, sa = np.cos(angles[..., k]), np.sin(angles[..., k]), np.cos(alpha), np.sin(alpha)
            step = np.zeros((*angles.shape[:-1], 4, 4))
            step[..., 0, 0], step[..., 0, 1], step[..., 0, 2], step[..., 0, 3] = ct, -st * ca, st * sa, a * ct
            step[..., 1, 0], step[..., 1, 1], step[..., 1, 2], step[..., 1, 3] = st, ct * ca, -ct * sa, a * st
            step[..., 2, 1], step[..., 2, 2], step[..., 2, 3], step[..., 3, 3] = sa, ca, d, 1.0
            out.append(out[-1] @ step)
        return out

    def tcp_matrix(self, q: Sequence[float] | Array, tcp_offset: Sequence[float] = (0.0,) * 6) -> Array:
        """Return the (4, 4) pose of the tool's centre point in the base frame."""
        return self.frames(q)[-1] @ transform(tcp_offset)

    def tcp_pose(self, q: Sequence[float] | Array, tcp_offset: Sequence[float] = (0.0,) * 6) -> Six:
        """Return the pose of the tool's centre point in the base frame, as the controller reports it."""
        return pose_of(self.tcp_matrix(q, tcp_offset))

    def jacobian(self, q: Sequence[float] | Array, tcp_offset: Sequence[float] = (0.0,) * 6) -> Array:
        """Return the (6, 6) Jacobian of the tool's centre point: [velocity; angular velocity] = J dq/dt, base frame."""
        frames = self.frames(q)
        point = (frames[-1] @ transform(tcp_offset))[:3, 3]
        columns = [np.concatenate([np.cross(f[:3, 2], point - f[:3, 3]), f[:3, 2]]) for f in frames[:6]]
        return np.stack(columns, axis=1)

    def solve_pose(
        self, target: Sequence[float] | Array, q_near: Sequence[float] | Array, tcp_offset: Sequence[float] = (0.0,) * 6
    ) -> Array:
        """Return joint angles (6,) near `q_near` that reach `target` within 1 µm and 1 µrad.

        Damped Newton steps on the pose error; InputError when they do not converge (out of reach, singular, or the
        start is too far away). Meant for polishing and for short Cartesian motions, not for global search.
        """
        goal = transform(target)
        q = np.array(q_near, dtype=np.float64)
        error = np.zeros(6)
        for _ in range(100):
            now = self.tcp_matrix(q, tcp_offset)
            error = np.concatenate([goal[:3, 3] - now[:3, 3], rotation_vector(goal[:3, :3] @ now[:3, :3].T)])
            if np.linalg.norm(error[:3]) < REACHED and np.linalg.norm(error[3:]) < REACHED:
                return q
            jacobian = self.jacobian(q, tcp_offset)
            damping = DAMPING * float(np.linalg.norm(error))
            step = np.linalg.solve(jacobian.T @ jacobian + damping * np.eye(6), jacobian.T @ error)
            q = q + step * min(1.0, 0.3 / max(float(np.abs(step).max()), EXACT))
        raise InputError(
            f"No joint angles of {self.name} near the start reach {np.round(np.asarray(target, dtype=float), 4)}: "
            f"{1e3 * float(np.linalg.norm(error[:3])):.1f} mm remain. Move the target within {self.reach_m} m of the "
            "base, or start from another arm configuration."
        )


def _degrees(*values: float) -> Six:
    a, b, c, d, e, f = np.radians(values)
    return float(a), float(b), float(c), float(d), float(e), float(f)


_UR5E = RobotModel(
    name="ur5e",
    dashboard_name="UR5",
    d=(0.1625, 0, 0, 0.1333, 0.0997, 0.0996),
    a=(0, -0.425, -0.3922, 0, 0, 0),
    joint_speed_rad_s=_degrees(180, 180, 180, 180, 180, 180),
    reach_m=0.85,
    payload_kg=5.0,
)
_UR10E = RobotModel(
    name="ur10e",
    dashboard_name="UR10",
    d=(0.1807, 0, 0, 0.17415, 0.11985, 0.11655),
    a=(0, -0.6127, -0.57155, 0, 0, 0),
    joint_speed_rad_s=_degrees(120, 120, 180, 180, 180, 180),
    reach_m=1.3,
    payload_kg=12.5,
    contact_force_n=8.0,
)
# Universal Robots gives the newer arms the kinematics of the older ones, with payloads of their own.
MODELS = MappingProxyType(
    {
        m.name: m
        for m in (
            RobotModel(
                name="ur3e",
                dashboard_name="UR3",
                d=(0.15185, 0, 0, 0.13105, 0.08535, 0.0921),
                a=(0, -0.24355, -0.2132, 0, 0, 0),
                joint_speed_rad_s=_degrees(180, 180, 180, 360, 360, 360),
                reach_m=0.5,
                payload_kg=3.0,
            ),
            _UR5E,
            replace(_UR5E, name="ur7e", payload_kg=7.5),
            _UR10E,
            replace(_UR10E, name="ur12e"),
            RobotModel(
                name="ur16e",
                dashboard_name="UR16",
                d=(0.1807, 0, 0, 0.17415, 0.11985, 0.11655),
                a=(0, -0.4784, -0.36, 0, 0, 0),
                joint_speed_rad_s=_degrees(120, 120, 180, 180, 180, 180),
                reach_m=0.9,
                payload_kg=16.0,
                contact_force_n=8.0,
            ),
            RobotModel(
                name="ur20",
                dashboard_name="UR20",
                d=(0.2363, 0, 0, 0.2010, 0.1593, 0.1543),
                a=(0, -0.8620, -0.7287, 0, 0, 0),
                joint_speed_rad_s=_degrees(120, 120, 150, 210, 210, 210),
                reach_m=1.75,
                payload_kg=20.0,
                contact_force_n=12.0,
            ),
            RobotModel(
                name="ur30",
                dashboard_name="UR30",
                d=(0.2363, 0, 0, 0.2010, 0.1593, 0.1543),
                a=(0, -0.6370, -0.5037, 0, 0, 0),
                joint_speed_rad_s=_degrees(120, 120, 150, 210, 210, 210),
                reach_m=1.3,
                payload_kg=30.0,
                contact_force_n=12.0,
            ),
        )
    }
)


def robot_model(name: str, where: str = "") -> RobotModel:
    """Return the arm called `name`; InputError with `where` it stands and the nearest known names for any other."""
    if name not in MODELS:
        place = f"{where}: unknown" if where else "Unknown"
        raise InputError(f"{place} robot model '{name}'; {nearest(name, MODELS)}")
    return MODELS[name]
