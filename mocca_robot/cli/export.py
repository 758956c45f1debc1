"""`mocca-robot export`: a design or an assembly in a format of other programs."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode
from mocca_robot.errors import InputError
from mocca_robot.files.documents import parse_json, read_text
from mocca_robot.files.output import make_folder, safe_file_names, write_atomic
from mocca_robot.tolerances import MM

if TYPE_CHECKING:
    from mocca_robot.assembly import Assembly, Mesh
    from mocca_robot.config.config import Config

FORMATS = {
    "svg": "flat parts nested on a sheet, real scale, kerf and clearance applied",
    "dxf": "the same for CAD and laser cutters",
    "obj": "one mesh per part, in metres; flat parts as plates",
    "stl": "one mesh per part, in millimetres",
    "3mf": "one mesh per part, in millimetres",
    "ply": "one mesh per part, in metres",
    "glb": "the whole assembly for viewers",
    "3dm": "the whole assembly for Rhino, in metres",
    "ifc": "the whole assembly for building programs (IFC 4), in metres",
    "mjcf": "a folder with a MuJoCo model that stands by itself",
    "urdf": "one per part, with its mesh",
    "json": "the parts as an assembly file",
    "figures": "a folder of vector figures for papers and slides, in 2D with a film",
    "dot": "the parts-graph for Graphviz: who is placed before whom, and which joints are between them",
    "graph-svg": "the same as a picture, in sequence order",
    "compas": "an Assembly of compas_assembly and compas_cra, with contacts and supports",
    "compas-model": "a BlockModel of compas_dem and compas_model",
    "csv": "of a plan.json its trajectories, of parts their bill",
    "urscript": "a plan.json as a program for a UR controller",
}
GRAPHS = {"dot": ".dot", "graph-svg": "_graph.svg"}
SHEETS, MESHES, WHOLE = ("svg", "dxf"), ("obj", "stl", "ply", "3mf"), ("glb", "3dm", "ifc")
LEAST_WALL_MM = {"svg": 1.0, "dxf": 1.0, "stl": 0.8, "3mf": 0.8}
"""Below, parts break or cannot be made: two lines of a 0.4 mm nozzle; charred wood beside a laser's cut."""


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
    parser.add_argument(
        "--min-wall",
        type=float,
        metavar="MM",
        help="warn of walls and slots thinner than this as made (default: 0.8 for stl and 3mf, 1 for svg and dxf)",
    )
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 after writing the files."""
    if not 0.0 < args.scale < 1e6:
        raise InputError(f"--scale {args.scale:g} is no size; give a number above 0, such as 0.1.")
    if args.bed and args.format not in ("stl", "3mf"):
        raise InputError(f"Print beds are written as stl or 3mf, not as {args.format}.")
    if args.clearance and args.format not in (*MESHES, *WHOLE):
        raise InputError(f"--clearance is for meshes; for {args.format} set cut.clearance (--set cut.clearance=0.1).")
    if args.min_wall is not None and not 0.0 <= args.min_wall < 1e6:
        raise InputError(f"--min-wall is {args.min_wall:g}; give a thickness in mm, 0 to ask for no check.")
    console = Console(args.json)
    with console.stage("export"):
        files, thin = (_write_plan(args), []) if _is_plan(args) else _write_parts(args)
    for line in thin:
        console.warn(f"warning: {line}")
    for file in files:
        console.say(str(file))
    return console.finish(
        ExitCode.POSITIVE, {"format": args.format, "files": [str(f) for f in files], "warnings": thin}
    )


def _is_plan(args: argparse.Namespace) -> bool:
    """Return whether the input is to be read as a plan: for urscript always, for csv when the file says so."""
    if args.format == "urscript":
        return True
    path = Path(args.input)
    if args.format != "csv" or path.suffix.lower() != ".json" or not path.is_file():
        return False
    from mocca_robot.files.versions import PLAN

    data = parse_json(read_text(path), f"'{path}'")
    return isinstance(data, dict) and data.get("format") == PLAN.name


def _write_plan(args: argparse.Namespace) -> list[Path]:
    from mocca_robot.cli.execute import export_urscript
    from mocca_robot.plan.reader import read_plan
    from mocca_robot.plan.trajectory_csv import trajectory_csv

    ending = ".csv" if args.format == "csv" else ".script"
    target = Path(args.output) if args.output else Path(args.input).with_suffix(ending)
    make_folder(target.parent)
    if args.format == "csv":
        return [write_atomic(target, trajectory_csv(read_plan(args.input)))]
    return [export_urscript(Path(args.input), target)]


def _write_parts(args: argparse.Namespace) -> tuple[list[Path], list[str]]:

    config = arguments.load(args)
    assembly = config.assembly
    stem = safe_file_names([assembly.name])[assembly.name]
    if args.format == "figures":
        return _write_figures(args, config, make_folder(Path(args.output or f"{stem}_figures"))), []
    if args.format in GRAPHS:
        return [_write_graph(args, config, Path(args.output or stem + GRAPHS[args.format]))], []
    if args.format in SHEETS:
        from mocca_robot.fabrication.clearance import with_clearance
        from mocca_robot.fabrication.cut import write_cut_dxf, write_cut_svg

        target = Path(args.output or f"{stem}.{args.format}")
        make_folder(target.parent)
        write = write_cut_svg if args.format == "svg" else write_cut_dxf
        files = [write(assembly, target, config.cut)]
        return files, _thin(args, with_clearance(assembly, config.cut.clearance))
    if args.format in ("mjcf", "urdf"):
        return _write_models(args.format, assembly, make_folder(Path(args.output or f"{stem}_{args.format}"))), []
    if args.format in (*MESHES, *WHOLE):
        return _write_meshes(args, assembly, stem)
    endings = {"compas": "_compas.json", "compas-model": "_compas.json", "csv": "_write_parts.csv", "json": ".json"}
    target = Path(args.output or stem + endings[args.format])
    make_folder(target.parent)
    return [_write_document(args.format, assembly, target)], []


def _write_graph(args: argparse.Namespace, config: Config, target: Path) -> Path:
    """Return `target` after writing the parts-graph there, with the joints of a design where the input is one."""
    from mocca_robot.cli.simulate import stored_design
    from mocca_robot.contacts.find import find_contacts, require_sound
    from mocca_robot.files.design_json import read_design
    from mocca_robot.files.stored_joints import joints_of
    from mocca_robot.motion.parts_graph import PartsGraph
    from mocca_robot.report.graph_drawing import graph_dot, graph_svg

    make_folder(target.parent)
    path = stored_design(Path(args.input))
    if path is None:
        report = find_contacts(config.assembly)
        require_sound(config.assembly, report)
        graph = PartsGraph.of(config.assembly, report.contacts, config.insertion)
    else:
        stored = read_design(path)
        source = stored.source or stored.assembly
        ways = {i.part: i.direction for i in stored.insertion}
        graph = PartsGraph.joined(source, joints_of(stored, find_contacts(source).contacts), ways)
    return write_atomic(target, graph_dot(graph) if args.format == "dot" else graph_svg(graph))


def _write_document(kind: str, assembly: Assembly, target: Path) -> Path:
    if kind == "json":
        from mocca_robot.files.assembly_json import write_assembly

        return write_assembly(assembly, target)
    if kind == "csv":
        from mocca_robot.fabrication.bill import bill_csv

        return write_atomic(target, bill_csv(assembly))
    from mocca_robot.contacts.find import find_contacts
    from mocca_robot.files.compas_write import write_compas

    if kind == "compas-model":
        return write_compas(assembly, target, kind="model")
    return write_compas(assembly, target, find_contacts(assembly).contacts)


def _write_meshes(args: argparse.Namespace, assembly: Assembly, stem: str) -> tuple[list[Path], list[str]]:
    from mocca_robot.fabrication.clearance import with_clearance
    from mocca_robot.files.mesh_write import write_parts
    from mocca_robot.geometry.extrusion import surface

    flat = assembly
    assembly = with_clearance(assembly, args.clearance * MM / args.scale) if args.clearance else assembly
    thin = _thin(args, assembly)
    meshes = [surface(p) for p in assembly.parts]
    assembly = assembly.with_shapes(meshes)
    if args.bed:
        return _write_beds(args, flat, assembly, make_folder(Path(args.output or stem))), thin
    if args.format in WHOLE:
        target = Path(args.output or f"{stem}.{args.format}")
        make_folder(target.parent)
        return [_write_whole(args.format, assembly, meshes, target)], thin
    folder = make_folder(Path(args.output or stem))
    names = safe_file_names(assembly.sequence)
    # Slicers read STL in millimetres; 3MF says its unit itself.
    unit = "mm" if args.format == "stl" else "m"
    return write_parts([names[n] for n in assembly.sequence], meshes, folder, args.format, unit), thin


def _write_whole(kind: str, assembly: Assembly, meshes: list[Mesh], target: Path) -> Path:
    """Return `target` after writing all parts into that one file."""
    if kind == "3dm":
        from mocca_robot.files.rhino import write_3dm

        return write_3dm(assembly.sequence, meshes, target)
    if kind == "ifc":
        from mocca_robot.files.ifc_write import write_ifc

        return write_ifc(assembly, target)
    from mocca_robot.files.mesh_write import write_glb

    return write_glb(assembly, target)


def _write_figures(args: argparse.Namespace, config: Config, folder: Path) -> list[Path]:
    from mocca_robot.cli import simulate, stages
    from mocca_robot.report.data import collect
    from mocca_robot.report.figures import write_figures
    from mocca_robot.verdicts.simulation_json import read_simulation

    console, stored = Console(args.json), simulate.stored_design(Path(args.input))
    if stored is None:
        outcome = stages.judge_as_is(config, stages.read_contacts(config.assembly, console), console)
    else:
        outcome = stages.judge_stored(stored, console)
    beside = None if stored is None else stored.with_name("simulation.json")
    simulation = read_simulation(beside) if beside is not None and beside.is_file() else None
    data = collect(
        outcome.design, before=outcome.before, after=outcome.after, states=outcome.states, simulation=simulation
    )
    return list(write_figures(folder, data))


def _thin(args: argparse.Namespace, assembly: Assembly) -> list[str]:
    from mocca_robot.fabrication.walls import warnings

    limit = LEAST_WALL_MM.get(args.format, 0.0) if args.min_wall is None else args.min_wall
    scale = args.scale if args.bed else 1.0
    return list(warnings(assembly, limit * MM, scale)) if limit > 0 else []


def _write_beds(args: argparse.Namespace, source: Assembly, assembly: Assembly, folder: Path) -> list[Path]:
    from mocca_robot.contacts.find import find_contacts
    from mocca_robot.fabrication.print_bed import print_beds, write_beds
    from mocca_robot.geometry.extrusion import standing

    sides = args.bed.lower().replace("×", "x").split("x")
    if len(sides) != 2 or not all(side.replace(".", "", 1).isdigit() and float(side) > 0 for side in sides):
        raise InputError(f"'{args.bed}' is no bed size; give width x depth in millimetres, such as --bed 220x220.")
    bed = (float(sides[0]) * MM, float(sides[1]) * MM)
    if not 0.0 <= args.label_depth < 1e3:
        raise InputError(f"--label-depth is {args.label_depth:g}; give a depth in mm, such as 0.4.")
    contacts = (
        [replace(c, polygon=standing(c.polygon), normal=standing(c.normal)) for c in find_contacts(source).contacts]
        if args.label_depth
        else ()
    )
    nested = print_beds(assembly, bed, scale=args.scale, label_depth=args.label_depth * MM, contacts=contacts)
    return write_beds(nested, folder, args.format)


def _write_models(kind: str, assembly: Assembly, folder: Path) -> list[Path]:
    from sim.show.mjcf import export_mjcf, export_urdf

    if kind == "urdf":
        return list(export_urdf(assembly, folder))
    from mocca_robot.contacts.find import find_contacts, require_sound
    from sim.shapes.contact_model import contact_model
    from sim.stability import free_scene

    report = find_contacts(assembly)
    require_sound(assembly, report)
    return [export_mjcf(free_scene(assembly, contact_model(assembly, report.contacts)), folder)]
