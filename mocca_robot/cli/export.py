"""`mocca-robot export`: a design or an assembly in a format of other programs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.errors import InputError
from mocca_robot.files.documents import parse_json, read_text

if TYPE_CHECKING:
    from mocca_robot.assembly import Assembly
    from mocca_robot.files.config import Config

FORMATS = {
    "svg": "flat parts nested on a sheet, real scale, kerf and clearance applied",
    "dxf": "the same for CAD and laser cutters",
    "obj": "one mesh per part",
    "stl": "one mesh per part, in millimetres",
    "3mf": "one mesh per part",
    "glb": "the whole assembly for viewers",
    "mjcf": "a folder with a MuJoCo model that stands by itself",
    "urdf": "one per part, with its mesh",
    "json": "the parts as an assembly file",
    "figures": "a folder of vector figures for papers and slides, in 2D with a film",
    "urscript": "a plan.json as a program for a UR controller",
}
SHEETS, MESHES = ("svg", "dxf"), ("obj", "stl", "3mf")


def add(commands: Any) -> None:
    """Add the command."""
    listed = "; ".join(f"{name}: {what}" for name, what in FORMATS.items())
    parser: argparse.ArgumentParser = commands.add_parser(
        "export", help="write parts for cutting, printing, viewers, robots", description=f"Formats: {listed}."
    )
    arguments.add_input(parser, "X")
    parser.add_argument("--format", required=True, choices=tuple(FORMATS), help="see above")
    parser.add_argument("-o", "--output", metavar="PATH", help="file, or folder for one file per part")
    parser.add_argument("--clearance", type=float, default=0.0, metavar="MM", help="play between solid parts, in mm")
    parser.add_argument(
        "--bed", metavar="WxD", help="nest stl or 3mf on print beds of this size in mm, such as 220x220"
    )
    parser.add_argument("--scale", type=float, default=1.0, metavar="S", help="size on the print bed, such as 0.1")
    parser.add_argument("--label-depth", type=float, default=0.0, metavar="MM", help="engrave numbers this deep, in mm")
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 after writing the files."""
    if not args.scale > 0.0:
        raise InputError(f"--scale {args.scale:g} is no size; give a number above 0, such as 0.1.")
    if args.bed and args.format not in ("stl", "3mf"):
        raise InputError(f"Print beds are written as stl or 3mf, not as {args.format}.")
    console = Console(args.json)
    with console.stage("export"):
        files = _plan(args) if args.format == "urscript" else _parts(args)
    for file in files:
        console.say(str(file))
    return console.finish(0, {"format": args.format, "files": [str(f) for f in files]})


def _plan(args: argparse.Namespace) -> list[Path]:
    from mocca_robot.ur.commands import export_urscript

    target = Path(args.output) if args.output else Path(args.input).with_suffix(".script")
    _writable(target.parent)
    return [export_urscript(Path(args.input), target)]


def _parts(args: argparse.Namespace) -> list[Path]:
    from mocca_robot.assembly import Mesh
    from mocca_robot.files.output import safe_file_names

    config = arguments.load(args)
    assembly = config.assembly
    stem = safe_file_names([assembly.name])[assembly.name]
    if args.format == "figures":
        return _figures(args, config, _writable(Path(args.output or f"{stem}_figures")))
    if args.format == "json":
        from mocca_robot.files.assembly_json import write_assembly

        target = Path(args.output or f"{stem}.json")
        _writable(target.parent)
        return [write_assembly(assembly, target)]
    if args.format in SHEETS:
        from mocca_robot.files.cut import write_cut_dxf, write_cut_svg

        target = Path(args.output or f"{stem}.{args.format}")
        _writable(target.parent)
        write = write_cut_svg if args.format == "svg" else write_cut_dxf
        return [write(assembly, target, config.cut)]
    if args.format in ("mjcf", "urdf"):
        return _models(args.format, assembly, _writable(Path(args.output or f"{stem}_{args.format}")))
    if assembly.dimension == 2:
        raise InputError(f"'{assembly.name}' is flat; export it as one of {', '.join(SHEETS)}, not as {args.format}.")
    from mocca_robot.files.clearance import with_clearance

    assembly = with_clearance(assembly, args.clearance * 1e-3 / args.scale) if args.clearance else assembly
    if args.bed:
        return _beds(args, assembly, _writable(Path(args.output or stem)))
    if args.format == "glb":
        from mocca_robot.files.meshes import write_glb

        target = Path(args.output or f"{stem}.glb")
        _writable(target.parent)
        return [write_glb(assembly, target)]
    from mocca_robot.files.meshes import write_parts

    folder = _writable(Path(args.output or stem))
    meshes = [p.shape for p in assembly.parts if isinstance(p.shape, Mesh)]
    names = safe_file_names(assembly.sequence)
    # Slicers read STL in millimetres; 3MF says its unit itself.
    unit = "mm" if args.format == "stl" else "m"
    return write_parts([names[n] for n in assembly.sequence], meshes, folder, args.format, unit)


def _figures(args: argparse.Namespace, config: Config, folder: Path) -> list[Path]:
    from mocca_robot.cli import simulate, stages
    from mocca_robot.report import collect
    from mocca_robot.report.figures import write_figures

    console, stored = Console(args.json), simulate.stored_design(Path(args.input))
    if stored is None:
        outcome = stages.judged_as_is(config, stages.read_contacts(config.assembly, console), console)
    else:
        outcome = stages.judged(stored, console)
    beside = None if stored is None else stored.with_name("simulation.json")
    simulation = parse_json(read_text(beside), f"'{beside}'") if beside is not None and beside.is_file() else None
    data = collect(
        outcome.design, before=outcome.before, after=outcome.after, states=outcome.states, simulation=simulation
    )
    return list(write_figures(folder, data))


def _beds(args: argparse.Namespace, assembly: Assembly, folder: Path) -> list[Path]:
    from mocca_robot.contacts import find_contacts
    from mocca_robot.files.print_bed import print_beds, write_beds

    sides = args.bed.lower().replace("×", "x").split("x")
    if len(sides) != 2 or not all(side.replace(".", "", 1).isdigit() and float(side) > 0 for side in sides):
        raise InputError(f"'{args.bed}' is no bed size; give width x depth in millimetres, such as --bed 220x220.")
    bed = (float(sides[0]) * 1e-3, float(sides[1]) * 1e-3)
    contacts = find_contacts(assembly).contacts if args.label_depth else ()
    nested = print_beds(assembly, bed, scale=args.scale, label_depth=args.label_depth * 1e-3, contacts=contacts)
    return write_beds(nested, folder, args.format)


def _models(kind: str, assembly: Assembly, folder: Path) -> list[Path]:
    from sim.mjcf import export_mjcf, export_urdf

    if kind == "urdf":
        return list(export_urdf(assembly, folder))
    from mocca_robot.contacts import find_contacts, require_sound
    from sim.contact_model import contact_model
    from sim.stability import free_scene

    report = find_contacts(assembly)
    require_sound(assembly, report)
    return [export_mjcf(free_scene(assembly, contact_model(assembly, report.contacts)), folder)]


def _writable(folder: Path) -> Path:
    from mocca_robot.files.output import writable_folder

    return writable_folder(folder)
