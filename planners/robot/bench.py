"""The cell while a plan is made: where everything stands now, and whether the arm may be somewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.plan.pose import transform
from planners.robot.arm_poses import trace
from planners.robot.cell import RobotCell
from planners.robot.scene import CellScene, straight
from planners.robot.site import Site
from planners.robot.trajectory import line
from planners.robot.tray import Tray

LINE_POSES = 24
"""Places at which a straight motion of less than 0.2 m is looked at while planning: less than 1 cm apart; the finished
plan is looked at again every millimetre."""
AWAY = straight(np.array([0.0, 0.0, 100.0]))
"""Where parts are while no tray is laid out."""


@dataclass
class Bench:
    """One thread's workbench: it holds a MuJoCo model. `tray` is None while seats are looked for."""

    cell: RobotCell
    site: Site
    scene: CellScene
    tray: Tray | None = None

    def __post_init__(self) -> None:
        self.to_flange = self.flange_offset(self.cell)
        self._limit = np.asarray(self.cell.model.joint_limit_rad)
        self._tool = np.asarray(self.cell.gripper.tcp_offset[:3])

    @staticmethod
    def flange_offset(cell: RobotCell) -> Array:
        """Return the (4, 4) matrix that takes a pose of the tool's centre point to the flange's, from the right."""
        return np.asarray(np.linalg.inv(transform(cell.gripper.tcp_offset)))

    def clear(self, tray: Tray | None) -> None:
        """Put every free part where it waits."""
        self.tray = tray
        for body in self.site.bodies:
            self.scene.place(body.name, np.eye(4) if body.fixed else self.waiting(body.name))

    def waiting(self, name: str) -> Array:
        """Return the motion (4, 4) from a part's place in the structure to where it waits."""
        return AWAY if self.tray is None else self.tray.motions[name]

    def free(self, q: Array, opening_m: float, grip: Array | None = None) -> str:
        """Return '' or what is wrong with a configuration."""
        if (np.abs(q) > self._limit).any():
            return "a joint at its limit"
        hit = self.scene.hit(q, opening_m, grip)
        if hit:
            return hit
        flange = self.scene.flange
        tcp = flange[:3, :3] @ self._tool + flange[:3, 3]
        low, high = self.cell.workspace_m
        return "outside the workspace box" if (tcp < low).any() or (tcp > high).any() else ""

    def along(
        self, start: Array, travel: Array, q_start: Array, opening_m: float, grip: Array | None = None
    ) -> tuple[Array, str]:
        """Return the joints where the straight way of the tool from flange pose `start` by `travel` ends, and '' or why
        it cannot be gone.
        """
        joints, reason = trace(self.cell.model, line(start, travel, LINE_POSES), q_start)
        if not reason:
            # The far end first: it is free least often.
            reason = next((r for q in reversed(joints) if (r := self.free(q, opening_m, grip))), "")
        return joints[-1], reason
