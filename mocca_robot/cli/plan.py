"""`mocca-robot plan`: from a design to a plan for a robot cell, with the tray that it needs."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import positive_if
from mocca_robot.cli.simulate import stored_design
from mocca_robot.errors import InputError

if TYPE_CHECKING:
    from planners.robot.build_result import BuildPlan

NAMES = 6
"""So many parts of a fall are named; the remedy names them all."""
DESCRIPTION = """Plans, for every part in sequence, how the arm picks it from the tray, carries it, inserts it along
the axis of its cone, lets go and retreats, without collisions and within all limits. Writes plan.json and the tray's
drawing. `mocca-robot execute` checks a plan and runs it."""


def add(commands: Any) -> None:
    """Add the command."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "plan", help="plan the build of a design with a robot", description=DESCRIPTION
    )
    parser.add_argument("design", metavar="DESIGN", help="design.json, or the folder that holds it")
    parser.add_argument("--cell", required=True, metavar="FILE", help="YAML file of the robot cell")
    parser.add_argument("-o", "--output", metavar="FILE", help="plan to write (default: plan.json beside the design)")
    parser.add_argument(
        "--supports",
        default="",
        metavar="PART,...",
        help="parts that something else holds once they are placed, besides the cell's; 'all' for every part",
    )
    parser.add_argument(
        "--cradles",
        default="",
        metavar="PART,...",
        help="parts that a cradle made to the design holds at their place once they are let go; 'all' for every part",
    )
    parser.add_argument("--size", type=float, metavar="M", help="longest side of the structure (default: the cell's)")
    parser.add_argument(
        "--friction", type=float, metavar="MU", help="Coulomb coefficient (default: what the design counts on, or 0)"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the random ways that are tried (default 0)")
    parser.add_argument(
        "--partial", action="store_true", help="when a part cannot be placed, write the plan of the parts before it"
    )
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 with a plan written, 1 with the reasons why there is none."""
    import os
    from dataclasses import replace

    from mocca_robot.files.design_json import read_design
    from mocca_robot.files.output import prepare_file
    from mocca_robot.plan.plan import write_plan
    from mocca_robot.plan.reader import file_sha256
    from planners.robot.build_plan import build_plan
    from planners.robot.cell import read_cell
    from planners.robot.recheck import recheck
    from planners.robot.tray_files import write_tray

    console = Console(args.json)
    source = stored_design(Path(args.design))
    if source is None:
        raise InputError(f"{args.design} is no design. Write one with `mocca-robot design`, and give its design.json.")
    with console.stage("read"):
        design = read_design(source)
        cell = read_cell(args.cell)
    if args.size is not None:
        if not 0.0 < args.size <= 10.0:
            raise InputError(f"--size is {args.size:g}; give the longest side in metres, above 0 and at most 10.")
        cell = replace(cell, build_size_m=args.size)
    target = prepare_file(args.output, source.with_name("plan.json"))
    names = [p.name for p in design.assembly.parts if not p.fixed]
    supports, cradles = (
        names if said == "all" else [n for n in said.split(",") if n] for said in (args.supports, args.cradles)
    )
    counted = 0.0 if design.friction is None else design.friction.coefficient
    friction = counted if args.friction is None else args.friction
    with console.stage("plan") as doing:
        built = build_plan(
            design,
            cell,
            file_sha256(source),
            friction=friction,
            supports=supports,
            cradles=cradles,
            seed=args.seed,
            partial=args.partial,
            progress=doing,
            design_path=os.path.relpath(source, target.parent),
        )
    wrong = []
    if built.plan is not None:
        with console.stage("check again"):
            wrong = [str(f) for f in recheck(built.plan, built.cell, built.site, built.tray)]
    written = []
    if built.plan is not None and not wrong:
        write_plan(built.plan, target)
        tray = write_tray(target, built.site, built.cell, built.tray)
        written = [str(target), *(str(t) for t in tray)]
    for line in [*lines(built), *wrong[:10], *(f"wrote {w}" for w in written)]:
        console.say(line)
    console.say(console.times())
    whole = written and all(r.placed for r in built.reports)
    return console.finish(positive_if(whole), {**document(built), "findings": wrong, "files": written})


def lines(built: BuildPlan) -> list[str]:
    """Return what was planned, for people."""
    import numpy as np

    from mocca_robot.plan.cycle import cycle_times

    out = []
    for fall in built.falls:
        shown = [*fall.moving[:NAMES], *([f"{len(fall.moving) - NAMES} more"] if len(fall.moving) > NAMES else [])]
        out.append(f"after {fall.part} is placed, {', '.join(shown)} would fall")
    if built.falls:
        together = dict.fromkeys(name for fall in built.falls for name in fall.moving)
        out.append(
            f"no plan: declare what holds them (--supports {','.join(together)}; --cradles for falsework that brings "
            "them to their place), try another sequence (`mocca-robot sequence`), or design for it (goal: support_free)"
        )
    for name in built.out_of_reach:
        out.append(f"{name} is out of the arm's reach: build nearer to the base, smaller, or with a longer arm")
    for r in built.reports:
        if r.placed:
            cone, usable = np.rad2deg(r.cone_rad), np.rad2deg(r.usable_rad)
            held = f"held over {1e3 * r.grasp_width_m:.1f} mm" if r.grasp_width_m else "held by the cup"
            out.append(
                f"{r.part}: {held}; {usable:.1f}° of its {cone:.1f}° cone usable; "
                f"{r.attempts} attempts, {r.seconds:.2f} s"
            )
        else:
            out.append(f"{r.part} cannot be placed ({r.attempts} attempts): {r.reasons}")
    if built.reports:
        x, y, z = built.cell.build_origin_m
        yaw = np.rad2deg(built.cell.build_yaw_rad)
        out.append(f"the structure stands at ({x:.3f}, {y:.3f}, {z:.3f}) m, turned by {yaw:.0f}°")
    if built.plan is not None:
        cycles = cycle_times(built.plan)
        out += [f"{c.part}: {c.words()}" for c in cycles]
        moving, standing = sum(c.moving_s for c in cycles), sum(c.standing_s for c in cycles)
        preset = built.plan.cell.limits.preset
        out.append(
            f"{len(cycles)} parts, {moving:.0f} s of motion and about {standing:.0f} s standing still, "
            f"{(moving + standing) / 60:.1f} min in all (preset '{preset}')"
        )
    return out


def document(built: BuildPlan) -> dict[str, Any]:
    """Return what was planned, for programs; angles in radians."""
    from mocca_robot.plan.cycle import cycle_times

    cycles = () if built.plan is None else cycle_times(built.plan)
    return {
        "planned": built.plan is not None and all(r.placed for r in built.reports),
        "steps": 0 if built.plan is None else len(built.plan.steps),
        "origin_m": built.cell.build_origin_m.tolist(),
        "yaw_deg": math.degrees(built.cell.build_yaw_rad),
        "parts": [dict(vars(r)) for r in built.reports],
        "cycles": [dict(vars(c)) for c in cycles],
        "falls": [{"part": f.part, "moving": list(f.moving)} for f in built.falls],
        "out_of_reach": list(built.out_of_reach),
    }
