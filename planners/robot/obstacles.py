"""What else stands in the cell: boxes that the arm, its tool and what it carries keep clear of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.optimize import linprog

from mocca_robot.arrays import Array, read_only
from mocca_robot.config.keys import read_whole
from mocca_robot.errors import InputError
from mocca_robot.files import fields
from mocca_robot.plan.arm_links import capsules
from mocca_robot.plan.arm_models import RobotModel
from planners.robot.cell_keys import CELL_KEYS, EXAMPLE

PEDESTAL_M = 0.01
ALONG = 24
"""Places along a link that are looked at."""


class PlacedPieces(Protocol):
    """A part where it belongs, as convex pieces (n, 3)."""

    @property
    def name(self) -> str:
        """Return its name."""
        ...

    @property
    def pieces(self) -> tuple[Array, ...]:
        """Return its pieces, base frame."""
        ...


@dataclass(frozen=True, eq=False)
class CellBox:
    """A box: its middle (3,), half its sides (3,), and its turn about z; base frame."""

    name: str
    middle: Array
    half: Array
    yaw_rad: float

    @property
    def carries_base(self) -> bool:
        """Return whether it ends where the base begins, as a pedestal does: the shoulder may touch it."""
        return bool(self.middle[2] + self.half[2] <= PEDESTAL_M)

    @property
    def turn(self) -> Array:
        """Return the box's axes (3, 3), as columns."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def local(self, points: Array) -> Array:
        """Return points (n, 3) of the base frame in the box's own."""
        return np.asarray((points - self.middle) @ self.turn)

    def placed(self, points: Array) -> Array:
        """Return points (n, 3) of the box's own frame in the base frame."""
        return np.asarray(points @ self.turn.T + self.middle)

    def distance(self, points: Array) -> Array:
        """Return how far points (n, 3) are from the box, 0 inside."""
        outside = np.maximum(np.abs(self.local(points)) - self.half, 0.0)
        return np.asarray(np.linalg.norm(outside, axis=1))

    def meets(self, corners: Array) -> bool:
        """Return whether the convex piece with these corners (n, 3) and the box have a point in common."""
        inside = self.local(corners)
        if (inside.min(axis=0) > self.half).any() or (inside.max(axis=0) < -self.half).any():
            return False
        # Weights of the corners, summing to one, whose mean lies in the box.
        within = np.vstack([inside.T, -inside.T])
        one = np.ones((1, len(corners)))
        found = linprog(
            np.zeros(len(corners)), within, np.concatenate([self.half, self.half]), one, [1.0], bounds=(0.0, None)
        )
        return bool(found.status == 0)


def read_obstacles(value: object, where: str) -> tuple[CellBox, ...]:
    """Return the obstacles of a cell file; InputError names what is wrong with one."""
    out = []
    for name, entry in fields.mapping(value, where).items():
        here = f"{where}.{name}"
        raw = read_whole(CELL_KEYS, entry, "obstacles.NAME", here, EXAMPLE)
        low, high = raw["box_m"]
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        yaw = float(np.deg2rad(raw["yaw_deg"]))
        out.append(CellBox(fields.part_name(name, where), read_only(middle), read_only(half), yaw))
    return tuple(out)


def require_clear(obstacles: Sequence[CellBox], model: RobotModel, home: Array, where: str) -> None:
    """Return if the arm at `home` (6,) is clear of every obstacle; InputError names the first and the link it holds."""
    frames = model.frames(home)
    for obstacle in obstacles:
        for link, (frame, parts) in enumerate(zip(frames[1:], capsules(model), strict=True)):
            if link == 0 and obstacle.carries_base:
                continue
            start = _link_frame(frame, link, model)
            for capsule in parts:
                share = np.linspace(0.0, 1.0, ALONG)[:, None]
                line = np.asarray(capsule.start) + share * (np.asarray(capsule.end) - np.asarray(capsule.start))
                reached = line @ start[:3, :3].T + start[:3, 3]
                gap = float(obstacle.distance(reached).min()) - capsule.radius
                if gap <= 0.0:
                    what = "contains" if obstacle.distance(reached[:1])[0] == 0.0 else "reaches into"
                    raise InputError(
                        f"{where}.{obstacle.name} {what} link {link} of the arm as it stands at home: give the "
                        "obstacle where it is in the frame of the robot's base, or another home_deg."
                    )


def _link_frame(after: Array, link: int, model: RobotModel) -> Array:
    """Return the frame in which a link's capsules are given: behind the joint's turn, before its offset."""
    a, d, alpha = model.a[link], model.d[link], model.alpha[link]
    back = np.eye(4)
    c, s = np.cos(alpha), np.sin(alpha)
    back[:3, :3] = [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]
    back[:3, 3] = [a, 0.0, d]
    return np.asarray(after @ np.linalg.inv(back))


def require_room(obstacles: Sequence[CellBox], bodies: Sequence[PlacedPieces], waiting: Mapping[str, Array]) -> None:
    """Return if no obstacle stands where a part belongs, or waits in the tray after the motion (4, 4) by its name;
    InputError names the first that does.
    """
    for obstacle in obstacles:
        for body in bodies:
            if any(obstacle.meets(p) for p in body.pieces):
                raise InputError(
                    f"Obstacle '{obstacle.name}' stands where part '{body.name}' belongs: move build.origin_m, or the "
                    "obstacle."
                )
            motion = waiting.get(body.name)
            if motion is not None and any(obstacle.meets(p @ motion[:3, :3].T + motion[:3, 3]) for p in body.pieces):
                raise InputError(
                    f"Obstacle '{obstacle.name}' stands where part '{body.name}' waits in the tray: move the tray, or "
                    "give tray.parts a place that is free."
                )
