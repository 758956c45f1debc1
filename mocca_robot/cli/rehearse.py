"""`mocca-robot rehearse`: a plan built in MuJoCo before any robot moves."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode, positive_if
from mocca_robot.errors import InputError

if TYPE_CHECKING:
    from typing import Any

    from sim.cell.rehearsal_result import PartRehearsal, Rehearsal

DESCRIPTION = """Builds a plan in MuJoCo: the arm follows the plan, the gripper holds parts by friction, parts slide in,
and after every release the structure is left alone until it rests. The code that drives it is the one that drives a
real arm. Writes rehearsal.json and rehearsal.html beside the plan."""


def add(commands: Any) -> None:
    """Add the command."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "rehearse", help="build a plan in MuJoCo, with arm, gripper and parts", description=DESCRIPTION
    )
    parser.add_argument("plan", type=Path, metavar="PLAN", help="plan.json, as `mocca-robot plan` writes it")
    parser.add_argument("--design", type=Path, metavar="FILE", help="design.json (default: the one the plan names)")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder for the results (default: the plan's)")
    parser.add_argument("--friction", type=float, default=0.0, metavar="MU", help="friction within joints (default 0)")
    parser.add_argument(
        "--pad-friction", type=float, metavar="MU", help="friction of pads or cup (default: the cell's)"
    )
    parser.add_argument(
        "--pose-noise",
        default="0",
        metavar="MM[,DEG]",
        help="standard deviation of where parts wait in the tray (default 0)",
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of that noise (default 0)")
    parser.add_argument(
        "--speed",
        type=float,
        default=1.0,
        metavar="X",
        help="play free motions X times as fast; the hand then has to hold X² times the accelerations",
    )
    parser.add_argument("--parts", type=int, metavar="N", help="only the first N parts of the plan")
    parser.add_argument("--film", type=Path, metavar="FILE", help="an .mp4, or else a folder of PNG frames")
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 when everything was placed and stands, 1 when not, 130 after Ctrl-C with what was seen until then."""
    from mocca_robot.files.design_json import read_design
    from mocca_robot.files.output import make_folder
    from mocca_robot.plan.reader import read_plan
    from mocca_robot.report.rehearsal import write_rehearsal_page
    from sim.cell.cell_film import film, write_cell_film
    from sim.cell.rehearsal import rehearse
    from sim.cell.rehearsal_json import rehearsal_to_data, write_rehearsal
    from sim.show.film import require_encoder

    console = Console(args.json)
    options = _options(args)
    if args.film:
        require_encoder(args.film)
    with console.stage("read"):
        plan = read_plan(args.plan, args.design)
        source = args.design or (args.plan.parent / plan.design if plan.design else None)
        if source is None or not Path(source).is_file():
            raise InputError(f"The design of {args.plan} is not where the plan says. Give it with --design.")
        design = read_design(source)
    folder = make_folder(args.output or args.plan.parent)
    if args.film:
        make_folder(args.film.parent)
    with console.stage("rehearse") as update, _Interruptible() as cancelled:

        def tell(part: PartRehearsal) -> None:
            update(part.part)
            console.say(line(part))

        result = rehearse(plan, design, options, progress=tell, cancelled=cancelled)
    files = {"rehearsal": write_rehearsal(result, folder / "rehearsal.json")}
    with console.stage("report"):
        moving = film(result.place, result.frames, result.chapters)
        files["report"] = write_rehearsal_page(folder / "rehearsal.html", rehearsal_to_data(result), moving)
    if args.film:
        with console.stage("film"):
            files["film"] = write_cell_film(moving, args.film)
    for words in closing(result):
        console.say(words)
    for path in files.values():
        console.say(f"wrote {path}")
    console.say(console.times())
    status = ExitCode.INTERRUPTED if result.interrupted else positive_if(result.succeeded)
    document = {**rehearsal_to_data(result), "files": {k: str(v) for k, v in files.items()}}
    return console.finish(status, {("wall_s" if k == "seconds" else k): v for k, v in document.items()})


def _options(args: argparse.Namespace) -> Any:
    from sim.cell.rehearsal_result import Options

    shift, _, turn = args.pose_noise.partition(",")
    try:
        noise = float(shift) / 1e3, math.radians(float(turn or 0.0))
    except ValueError:
        raise InputError(f"--pose-noise is '{args.pose_noise}'; write millimetres, or millimetres,degrees.") from None
    return Options(
        friction=args.friction,
        pad_friction=args.pad_friction,
        noise_m=noise[0],
        noise_rad=noise[1],
        seed=args.seed,
        speed=args.speed,
        parts=args.parts,
    )


class _Interruptible:
    """Ctrl-C inside only sets a flag: what is finished is written first."""

    def __enter__(self) -> Any:
        import signal

        self._asked = False

        def ask(number: int, frame: object) -> None:
            self._asked = True

        self._before = signal.signal(signal.SIGINT, ask)
        return lambda: self._asked

    def __exit__(self, *_: object) -> None:
        import signal

        signal.signal(signal.SIGINT, self._before)


def line(part: PartRehearsal) -> str:
    """Return what was seen of one part, for people."""
    words = []
    if part.width_m is not None:
        words.append(f"held over {1e3 * part.width_m:.1f} mm" if part.width_m else "held by the cup")
    if part.slip_m is not None and part.slip_rad is not None:
        words.append(f"slipped {1e3 * part.slip_m:.2f} mm, {math.degrees(part.slip_rad):.1f}°")
    if part.depth_m is not None and part.wanted_m is not None:
        pushes = "1 push" if part.attempts == 1 else f"{part.attempts} pushes"
        words.append(
            f"in by {1e3 * part.depth_m:.1f} of {1e3 * part.wanted_m:.1f} mm, {pushes}, {part.peak_force_n or 0:.1f} N"
        )
    if part.standing is not None:
        fell = "OUT OF PLACE" if part.standing.on_support else "FALLS"
        verdict = {True: "stands", False: fell, None: "NO VERDICT"}[part.standing.stands]
        words.append(f"{verdict}: {part.standing.reason}")
    if part.detail:
        words.append(f"{part.status}: {part.detail}")
    words.extend(f"touched: {what}, {force:.1f} N" for what, force in part.touches)
    return f"{part.part}: " + "; ".join(words)


def closing(result: Rehearsal) -> list[str]:
    """Return the verdict on the whole, for people."""
    placed = sum(p.succeeded for p in result.parts)
    out = [f"{placed} of {result.planned} parts placed; {result.simulated_s:.0f} s simulated in {result.seconds:.0f} s"]
    if result.whole is not None:
        verdict = {True: "stands", False: "falls", None: "gives no verdict"}[result.whole.stands]
        what = "what was built" if result.partial else "the whole"
        if result.plan.supports:
            what += " with its supports" if result.partial else " without its supports"
        out.append(f"{what} {verdict}: {result.whole.reason}")
    if result.interrupted:
        out.append("interrupted: what was seen until then is written")
    return out
