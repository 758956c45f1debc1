"""`mocca-robot register`: where build place, tray, table and obstacles really are, by touching them with the arm."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode
from mocca_robot.errors import InputError
from mocca_robot.tolerances import MM

if TYPE_CHECKING:
    from mocca_robot.arrays import Array
    from mocca_robot.plan.arm_models import RobotModel
    from planners.robot.cell import RobotCell

DESCRIPTION = """Finds where a thing of the cell really is: you lead the arm's tip to points of it with the pendant's
freedrive and press Enter at each; this program only looks and never moves the arm. Shows how well the points agree, and
writes the cell file with what was found. Payload and tool are compared with the controller's first."""


def add(commands: Any) -> None:
    """Add the command."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "register", help="find build place, tray, table or an obstacle by touching points", description=DESCRIPTION
    )
    parser.add_argument("cell", type=Path, metavar="CELL", help="YAML file of the robot cell")
    parser.add_argument("thing", metavar="THING", help="build, tray, table, or an obstacle's name")
    parser.add_argument("--robot", required=True, metavar="HOST", help="address of the controller; it is only read")
    parser.add_argument(
        "--points",
        metavar="X,Y;X,Y;...",
        help="the points to touch, on the thing, in millimetres (default: of build, marks at 0,0, 100,0 and 0,100; of "
        "tray and obstacle, their corners from the lowest on, the obstacle's at its top; of table, any three)",
    )
    parser.add_argument(
        "--tip",
        metavar="X,Y,Z",
        help="the tip that touches, in the flange's frame, millimetres (default: the cell's TCP)",
    )
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="cell file to write (default: only say it)")
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 with what was found; InputError for points that fix nothing or contradict each other."""
    import numpy as np

    from planners.robot.cell import read_cell
    from planners.robot.registration import fit, marks, registered

    console = Console(args.json)
    cell = read_cell(args.cell)
    known = marks(cell, args.thing, [(row[0], row[1]) for row in _rows(args.points, 2, "--points")])
    touched = _touched(args, cell, known, console)
    found = fit(args.thing, known, touched)
    document = registered(cell, args.thing, found)
    place = ", ".join(f"{v / MM:.1f}" for v in found.shift)
    yaw, tilt, worst = np.rad2deg(found.yaw_rad), np.rad2deg(found.tilt_rad), float(found.residuals_m.max()) / MM
    console.say(f"{args.thing} lies at ({place}) mm, turned by {yaw:.2f}°, leaning by {tilt:.2f}°")
    console.say(f"the points agree to {worst:.2f} mm")
    if len(known) == 3:
        console.say("three points: a fourth would show mistakes that these cannot (--points)")
    written = _write(args.output, document, args.cell) if args.output is not None else ""
    console.say(f"wrote {written}" if written else "not written: give -o FILE")
    report = {
        "thing": args.thing,
        "shift_m": found.shift.tolist(),
        "yaw_rad": found.yaw_rad,
        "tilt_rad": found.tilt_rad,
        "residuals_m": found.residuals_m.tolist(),
        "file": written,
    }
    return console.finish(ExitCode.POSITIVE, report)


def _touched(args: argparse.Namespace, cell: RobotCell, known: Array, console: Console) -> Array:
    """Return the places (n, 3) of the tip that a person led to the points `known`, one after the other."""
    import numpy as np

    from mocca_robot.plan.pose import six
    from mocca_robot.ur.link import require_client
    from mocca_robot.ur.touching import Touching

    tip = cell.gripper.tcp_offset
    if args.tip is not None:
        (place,) = _rows(args.tip, 3, "--tip") or [()]
        tip = six([*place, 0.0, 0.0, 0.0])
    require_client()
    with Touching(args.robot, _arm(args.robot, cell)) as arm:
        if differs := arm.differs(cell.gripper.tcp_offset, cell.gripper.mass_kg):
            raise InputError(f"Before anybody leads the arm: {'; '.join(differs)}.")
        console.say("tool and payload are the cell's; take the arm into freedrive with the pendant")
        touched = []
        for k, point in enumerate(known):
            x, y = point[:2] / MM
            where = "anywhere on it" if args.thing == "table" else f"at x {x:.0f}, y {y:.0f} mm on it"
            console.say(f"point {k + 1} of {len(known)}: touch {args.thing} {where}, hold still, press Enter")
            if not sys.stdin.readline():
                raise InputError("The input has ended before all points were touched. Nothing was written.")
            touched.append(arm.tip(tip))
            console.say("  at " + ", ".join(f"{v / MM:.1f}" for v in touched[-1]) + " mm")
    return np.array(touched)


def _arm(host: str, cell: RobotCell) -> RobotModel:
    """Return the arm at `host` as its factory measured it, if it says so; InputError when it is another cell's."""
    from mocca_robot.plan.arm_models import robot_model
    from mocca_robot.plan.calibration import calibrated
    from mocca_robot.ur.dashboard import identify
    from mocca_robot.ur.primary import read_calibration

    identity, nominal = identify(host), robot_model(cell.model.name)
    if cell.serial is not None and cell.serial != identity.serial:
        raise InputError(f"The cell is for robot {cell.serial}; {host} is robot {identity.serial}.")
    calibration = read_calibration(host)
    return nominal if calibration is None else calibrated(nominal, calibration)


def _rows(text: str | None, count: int, option: str) -> list[tuple[float, ...]]:
    """Return points in metres from 'X,Y;X,Y' in millimetres."""
    try:
        rows = [tuple(MM * float(v) for v in row.split(",")) for row in (text or "").split(";") if row.strip()]
    except ValueError:
        rows = [()]
    if any(len(r) != count or not all(abs(v) < 10.0 for v in r) for r in rows):
        raise InputError(
            f"{option} is '{text}'; write {count} numbers in millimetres a point, such as 0,0;100,0;0,100."
        )
    return rows


def _write(path: Path, document: dict[str, Any], source: Path) -> str:
    import yaml

    from mocca_robot.files.output import write_atomic
    from planners.robot.cell import cell_from_document

    cell_from_document(document, str(path))  # what is written can be read again
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, allow_unicode=True)
    return str(write_atomic(path, f"# {source.name}, with what was found by touching it.\n{text}"))
