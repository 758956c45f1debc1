"""A small made-up cell for the robot tests: a UR5e that picks parts from a tray and slides them in, and a fake of it."""

from __future__ import annotations

import contextlib
import math
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mocca_robot.ur.limits import Limits
from mocca_robot.ur.models import robot_model
from mocca_robot.ur.plan import Cell, Grasp, Move, MoveKind, Plan, Step, Waypoint
from mocca_robot.ur.pose import six

MODEL = robot_model("ur5e")
TOOL = (0.0, 0.0, 0.15, 0.0, 0.0, 0.0)
HOME = np.array([0.0, -1.57, 1.57, -1.57, -1.57, 0.0])
SERIAL = "20265500042"
CELL = Cell(
    name="bench",
    tcp_offset=TOOL,
    workspace_m=((-0.8, -0.8, 0.0), (0.8, 0.8, 0.9)),
    tool_mass_kg=0.9,
    tool_cog_m=(0.0, 0.0, 0.05),
    serial=SERIAL,
)
WIDTH = 0.03
SPEEDUP = 4.0


def line(start: Waypoint, to: Sequence[float], speed: float, acceleration: float, points: int = 12) -> tuple[Waypoint, ...]:
    """Return a straight minimum-jerk motion from a waypoint to a position, orientation kept."""
    a, b = np.array(start.tcp[:3]), np.asarray(to, dtype=float)
    length = float(np.linalg.norm(b - a))
    seconds = max(1.875 * length / (0.9 * speed), math.sqrt(5.78 * length / (0.8 * acceleration)), 0.2)
    out, q = [], np.array(start.q)
    for u in np.linspace(0.0, 1.0, points):
        s = u**3 * (10 - 15 * u + 6 * u * u)
        q = MODEL.solve_pose([*(a + s * (b - a)), *start.tcp[3:]], q, TOOL)
        out.append(Waypoint(float(u * seconds), six(q), MODEL.tcp_pose(q, TOOL)))
    return tuple(out)


def small_plan(parts: int = 2, limits: Limits | None = None) -> Plan:
    """Return a plan that places `parts` parts, with one alternative direction for every insertion."""
    at = Waypoint(0.0, six(HOME), MODEL.tcp_pose(HOME, TOOL))
    home = np.array(at.tcp[:3])
    steps = []
    for k in range(parts):
        tray = home + [0.0, -0.04 - 0.03 * k, -0.05]
        seat = home + [0.0, 0.02 + 0.03 * k, -0.06]
        moves: list[Move] = []

        def add(kind: MoveKind, to: Sequence[float] | None, gripper: float, points: int = 12) -> None:
            nonlocal at
            speed, acceleration = {
                MoveKind.TRANSIT: (0.10, 0.5), MoveKind.INSERT: (0.01, 0.1), MoveKind.RELEASE: (0.02, 0.5)
            }.get(kind, (0.02, 0.5))
            path = (replace(at, t=0.0),) if to is None else line(at, to, speed, acceleration, points)
            others: tuple[tuple[Waypoint, ...], ...] = ()
            if kind is MoveKind.INSERT and to is not None:
                tilted = np.asarray(to) - 0.008 * np.array([math.sin(0.1), 0.0, -math.cos(0.1)])
                q = MODEL.solve_pose([*tilted, *at.tcp[3:]], at.q, TOOL)
                others = (line(Waypoint(0.0, six(q), MODEL.tcp_pose(q, TOOL)), to, speed, acceleration, points),)
            moves.append(Move(kind, path, speed, 20.0, gripper, others))
            at = path[-1]

        add(MoveKind.TRANSIT, tray + [0, 0, 0.02], 0.05)
        add(MoveKind.APPROACH, tray + [0, 0, 0.006], 0.05)
        add(MoveKind.PICK, tray, WIDTH - 0.002)
        add(MoveKind.LIFT, tray + [0, 0, 0.01], WIDTH - 0.002)
        add(MoveKind.TRANSIT, seat + [0, 0, 0.02], WIDTH - 0.002)
        add(MoveKind.APPROACH, seat + [0, 0, 0.008], WIDTH - 0.002)
        add(MoveKind.INSERT, seat, WIDTH - 0.002)
        add(MoveKind.RELEASE, None, 0.05)
        add(MoveKind.RETREAT, seat + [0, 0, 0.02], 0.05)
        steps.append(
            Step(f"p{k + 1:02d}", Grasp(WIDTH, 0.2, (0.0, 0.0, 0.15)), tuple(moves), (0.0, 0.0, -1.0), math.radians(10))
        )
    cell = CELL if limits is None else replace(CELL, limits=limits)
    return Plan("0" * 64, "ur5e", "2f85", cell, tuple(steps))


def loopback(number: int) -> str:
    """Return an address of its own for a fake controller: parallel workers and runs do not meet."""
    return f"127.{16 + os.getpid() % 200}.{os.getpid() // 200 % 250}.{2 + number}"


@contextlib.contextmanager
def fake_controller(plan_file: Path, host: str, *options: str) -> Iterator[str]:
    """Run a fake controller in a process of its own and yield its address."""
    command = [sys.executable, "-m", "mocca_robot.ur.fake", "--host", host, "--plan", str(plan_file)]
    process = subprocess.Popen(
        [*command, "--speedup", str(SPEEDUP), *options], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    try:
        assert process.stdout is not None
        first = process.stdout.readline()
        assert "serving" in first, first + (process.stdout.read() if process.poll() is not None else "")
        yield host
    finally:
        process.terminate()
        process.wait(10)
