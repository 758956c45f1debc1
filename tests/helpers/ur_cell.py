"""A small made-up cell for the robot tests: a UR5e picks parts from a tray and slides them in. And a fake of it."""

from __future__ import annotations

import contextlib
import functools
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mocca_robot.errors import InputError
from mocca_robot.plan.arm_models import robot_model
from mocca_robot.plan.plan import Cell, Grasp, Move, MoveKind, Plan, Step, Waypoint, write_plan
from mocca_robot.plan.pose import six
from mocca_robot.plan.status import ArmState
from mocca_robot.plan.wiring import VacuumWiring
from mocca_robot.ur.fake.controller import ask
from mocca_robot.ur.priority import preferred

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
CLOSED, OPENED = WIDTH - 0.002, 0.05
SPEEDUP = 4.0
WIRING = VacuumWiring("standard_3", "configurable_1", 0.5)

REST = ArmState(
    time_s=0.0,
    q=(0.0,) * 6,
    qd=(0.0,) * 6,
    tcp=(0.4, 0.0, 0.3, 0.0, 0.0, 0.0),
    force=(0.0,) * 6,
    speed_scaling=1.0,
    robot_mode=7,
    safety_mode=1,
    runtime_state=2,
    status_bits=3,
    safety_bits=1,
    payload_kg=0.9,
)
"""An arm that stands still, as its controller reports it."""


def line(
    start: Waypoint, to: Sequence[float], speed: float, acceleration: float, points: int = 12
) -> tuple[Waypoint, ...]:
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


def above(height: float) -> np.ndarray:
    """Return a displacement straight up."""
    return np.array([0.0, 0.0, height])


SPEEDS = {MoveKind.TRANSIT: (0.10, 0.5), MoveKind.INSERT: (0.01, 0.1)}


Stop = tuple[MoveKind, np.ndarray | None, float]


def moves_through(at: Waypoint, stops: Sequence[Stop]) -> tuple[Move, ...]:
    """Return straight moves from stop to stop (None: no motion); an insertion has one alternative, 5.7° off."""
    moves: list[Move] = []
    for kind, to, gripper in stops:
        speed, acceleration = SPEEDS.get(kind, (0.02, 0.5))
        path = (replace(at, t=0.0),) if to is None else line(at, to, speed, acceleration)
        others: tuple[tuple[Waypoint, ...], ...] = ()
        if kind is MoveKind.INSERT and to is not None:
            tilted = to - 0.008 * np.array([math.sin(0.1), 0.0, -math.cos(0.1)])
            q = MODEL.solve_pose([*tilted, *at.tcp[3:]], at.q, TOOL)
            others = (line(Waypoint(0.0, six(q), MODEL.tcp_pose(q, TOOL)), to, speed, acceleration),)
        moves.append(
            Move(kind=kind, path=path, speed_m_s=speed, force_limit_n=20.0, gripper_m=gripper, alternatives=others)
        )
        at = path[-1]
    return tuple(moves)


def full_stops(tray: np.ndarray, seat: np.ndarray, width: float = WIDTH) -> list[Stop]:
    """Return the way of a part of that width from its tray to its seat."""
    closed, opened = width - 0.002, min(width + 0.02, 0.085)
    return [
        (MoveKind.TRANSIT, tray + above(0.02), opened),
        (MoveKind.APPROACH, tray + above(0.006), opened),
        (MoveKind.PICK, tray, closed),
        (MoveKind.LIFT, tray + above(0.01), closed),
        (MoveKind.TRANSIT, seat + above(0.02), closed),
        (MoveKind.APPROACH, seat + above(0.008), closed),
        (MoveKind.INSERT, seat, closed),
        (MoveKind.RELEASE, None, opened),
        (MoveKind.RETREAT, seat + above(0.02), opened),
    ]


def short_stops(start: np.ndarray, beside: np.ndarray) -> list[Stop]:
    """Return a part that is picked where the arm stands and goes in right below it: quick to rehearse."""
    return [
        (MoveKind.APPROACH, None, OPENED),
        (MoveKind.PICK, None, CLOSED),
        (MoveKind.APPROACH, start - above(0.004), CLOSED),
        (MoveKind.INSERT, start - above(0.012), CLOSED),
        (MoveKind.RELEASE, None, OPENED),
        (MoveKind.RETREAT, start - above(0.004), OPENED),
        (MoveKind.TRANSIT, beside, OPENED),
    ]


def small_plan(parts: int = 2, short: bool = False, widths: Sequence[float] = ()) -> Plan:
    """Return a plan that places `parts` parts; those that do not wait where the hand stands may have other widths."""
    at = Waypoint(0.0, six(HOME), MODEL.tcp_pose(HOME, TOOL))
    home = np.array(at.tcp[:3])
    steps = []
    for k in range(parts):
        tray, seat = home + np.array([0, -0.04 - 0.03 * k, -0.05]), home + np.array([0, 0.02 + 0.03 * k, -0.06])
        start, beside = home + np.array([0, 0.04 * k, 0]), home + np.array([0, 0.04 * (k + 1), 0])
        width = widths[k] if widths else WIDTH
        moves = moves_through(at, short_stops(start, beside) if short else full_stops(tray, seat, width))
        at = moves[-1].path[-1]
        grasp = Grasp(width_m=width, mass_kg=0.2, cog_m=(0.0, 0.0, 0.15))
        steps.append(Step(f"p{k + 1:02d}", grasp, moves, (0.0, 0.0, -1.0), math.radians(10)))
    return Plan(design_sha256="0" * 64, robot="ur5e", gripper="2f85", cell=CELL, steps=tuple(steps))


def suction_plan(parts: int = 1, short: bool = False, wiring: VacuumWiring = WIRING) -> Plan:
    """Return the same plan for a suction cup: opening 0 is vacuum, 10 mm none."""
    plan = small_plan(parts, short)
    steps = [
        replace(
            s,
            grasp=replace(s.grasp, width_m=0.0),
            moves=tuple(replace(m, gripper_m=0.0 if m.gripper_m == CLOSED else 0.01) for m in s.moves),
        )
        for s in plan.steps
    ]
    cell = replace(plan.cell, gripper_stroke_m=(0.0, 0.01), vacuum=wiring)
    return replace(plan, gripper="suction", cell=cell, steps=tuple(steps))


def loopback(number: int) -> str:
    """Return an address of its own for a fake controller: parallel workers and runs do not meet."""
    return f"127.{16 + os.getpid() % 200}.{os.getpid() // 200 % 250}.{2 + number}"


def environment() -> dict[str, str]:
    """Return the environment in which another Python process finds the same modules."""
    root = str(Path(__file__).resolve().parents[2])
    return {**os.environ, "PYTHONPATH": root, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


PAUSES: list[float] = []
"""How long each fake controller of the present test was not run by the computer, at the worst."""
PAUSE_S = 0.06


def undisturbed(test: Callable[..., None]) -> Callable[..., None]:
    """Repeat a failed test, twice at most, if the computer kept the fake or the driver from running meanwhile.

    A controller that falls silent for 100 ms has to be stopped, whatever kept it silent. A real one runs on a computer
    of its own; the fake shares one with other tests, and its silence says nothing about the driver.
    """

    @functools.wraps(test)
    def repeated(*, tmp_path: Path, **others: object) -> None:
        for attempt in range(3):
            PAUSES.clear()
            place = tmp_path / f"attempt{attempt}"
            place.mkdir()
            try:
                with preferred():
                    test(tmp_path=place, **others)
                return
            except (AssertionError, InputError, subprocess.TimeoutExpired) as failure:
                paused = max(PAUSES, default=0.0) >= PAUSE_S or "ms old" in str(failure)
                if attempt == 2 or not paused:
                    raise

    return repeated


def written(plan: Plan, folder: Path) -> Path:
    """Return the plan's file in `folder`."""
    write_plan(plan, folder / "plan.json")
    return folder / "plan.json"


@contextlib.contextmanager
def fake_controller(plan_file: Path, host: str, *options: str) -> Iterator[str]:
    """Run a fake controller in a process of its own and yield its address."""
    command = [sys.executable, "-m", "mocca_robot.ur.fake", "--host", host, "--plan", str(plan_file)]
    process = subprocess.Popen(
        [*command, "--speedup", str(SPEEDUP), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment(),
    )
    try:
        assert process.stdout is not None
        first = process.stdout.readline()
        assert "serving" in first, first + (process.stdout.read() if process.poll() is not None else "")
        yield host
    finally:
        with contextlib.suppress(OSError, ValueError):
            PAUSES.append(float(ask(host)["longest_pause_s"]))
        process.terminate()
        process.wait(10)


CLI = """
import argparse, sys
from mocca_robot.errors import MoccaError
from mocca_robot.cli.execute import register
parser = argparse.ArgumentParser()
register(parser.add_subparsers(required=True))
args = parser.parse_args()
try:
    sys.exit(args.run(args))
except MoccaError as error:
    print(error, file=sys.stderr)
    sys.exit(2)
"""


def command(*arguments: object) -> list[str]:
    """Return the command line that runs one of this package's robot commands in a process of its own.

    The made-up cell has no design: its plans run without a second look.
    """
    unchecked = ["--unchecked"] if arguments[0] == "execute" else []
    return [sys.executable, "-c", CLI, *map(str, arguments), *unchecked]


def run(*arguments: object, **environment_too: str) -> subprocess.CompletedProcess[str]:
    """Return a finished robot command, its output captured."""
    everything = {**environment(), **environment_too}
    return subprocess.run(command(*arguments), env=everything, capture_output=True, text=True, timeout=90)
