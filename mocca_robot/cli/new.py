"""`mocca-robot new`: a commented configuration for somebody's own model, which runs as it is."""

from __future__ import annotations

import argparse
import math
import os
import shlex
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode
from mocca_robot.errors import InputError

if TYPE_CHECKING:
    from mocca_robot.assembly import Assembly
    from mocca_robot.config.config import Config
    from mocca_robot.config.starter import Source

DESCRIPTION = """Writes NAME.yaml, with comments and every key. --from names your model: an SVG or DXF drawing, a mesh
file or a folder of meshes, an assembly or a design as JSON (COMPAS too), the surface of a shell (OBJ that is not
closed), or a graph of lines (OBJ with lines, or JSON with nodes and rods). The model stays where it is. Without --from
it also writes a small drawing for you to start from. It overwrites nothing."""

SHARES = (0.04, 0.02, 0.01, 0.005)
"""Thickness of a shell as a share of the surface's diagonal; the first that gives sound blocks is taken."""
SECTIONS = (0.12, 0.06, 0.03)
"""Width of a frame's rods as a share of the shortest one."""
LEAST_ALPHA_DEG = 0.1
"""Smallest α that is worth asking for."""
FEW = 60
"""Up to so many parts an order of assembly is searched; beyond, parts come by height."""


def add(commands: Any) -> None:
    """Add the command."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "new", help="write a commented configuration for your own model", description=DESCRIPTION
    )
    parser.add_argument("name", metavar="NAME", help="name of the structure; the file is NAME.yaml")
    parser.add_argument("--from", dest="source", metavar="MODEL", help="your drawing, meshes, surface or lines")
    parser.add_argument("--units", metavar="UNIT", help="unit of a model whose file has none: mm, cm, m, in, …")
    parser.add_argument("-o", "--output", default=".", metavar="DIR", help="folder for the files (default: here)")
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 after writing the configuration."""
    from mocca_robot.config import starter
    from mocca_robot.files.fields import UNITS_M, choice
    from mocca_robot.files.output import make_folder, write_atomic

    model = Path(args.name)
    if args.source is None and model.suffix.lower() not in ("", ".yaml", ".yml") and model.is_file():
        told = f"mocca-robot new {shlex.quote(model.stem)} --from {shlex.quote(args.name)}"
        raise InputError(
            f"'{model}' is a file, but NAME is what the structure is called. If the file is your model: {told}"
        )
    name = starter.require_name(args.name)
    if args.units is not None:
        choice(args.units, tuple(UNITS_M), "--units")
    console = Console(args.json)
    folder = Path(args.output)
    target, drawing = folder / f"{name}.yaml", folder / f"{name}.svg"
    for file in (target, *([] if args.source else [drawing])):
        if file.exists() or file.is_symlink():
            raise InputError(f"'{file}' is there already and is kept; choose another name, or move it away.")
    source = starter.source_of(Path(args.source)) if args.source else None
    make_folder(folder)
    if source is None:
        write_atomic(drawing, starter.DRAWING)
        source = starter.Source(starter.PARTS, drawing)
    with console.stage("read"):
        text, config, notes = _configuration(name, source, folder, args.units, console)
    files = [write_atomic(target, text), *([] if args.source else [drawing])]
    for note in (*config.notes, *notes):
        console.warn(f"note: {note}")
    assembly = config.assembly
    fixed = ", ".join(p.name for p in assembly.parts if p.fixed)
    console.say(f"{assembly.dimension}D, {len(assembly.parts)} parts, {assembly.size:.3g} m across; fixed: {fixed}")
    for file in files:
        console.say(str(file))
    console.say(f"next: mocca-robot check '{target}', then mocca-robot run '{target}'")
    found = {"files": [str(f) for f in files], "kind": source.kind, "parts": len(assembly.parts)}
    return console.finish(ExitCode.POSITIVE, {**found, "notes": [*config.notes, *notes]})


def _configuration(
    name: str, source: Source, folder: Path, units: str | None, console: Console
) -> tuple[str, Config, list[str]]:
    """Return the YAML, what it comes to when loaded from `folder`, and notes on what had to be guessed."""
    from mocca_robot.config import starter

    inside = Path(os.path.relpath(source.path.resolve(), folder.resolve())).as_posix()
    if source.kind == starter.PARTS:
        if units is None and starter.lacks_unit(source.path):
            raise InputError(f"'{source.path}' carries no unit; add one of {starter.sizes_by_unit(source.path)}.")
        return _of_parts(name, source, inside, folder, units, console)
    tried: list[str] = []
    guesses = SHARES if source.kind == starter.SHELL else SECTIONS
    for share in guesses:
        parts_from = {"generator": _generator(source, inside, share, units or "m")}
        try:
            config, notes = _sound(parts_from, folder)
        except InputError as error:
            tried.append(str(error))
            continue
        what = "thickness" if source.kind == starter.SHELL else "width and height"
        read_as = "" if units else "; the file says no unit and was read as metres (--units)"
        notes.append(f"{what} of the parts: a guess{read_as}")
        return starter.starter_yaml(name, parts_from, config.assembly, _allowed(config.assembly)), config, notes
    raise InputError(f"'{source.path}' makes no {source.kind}: {tried[-1]}")


def _generator(source: Source, inside: str, share: float, units: str) -> dict[str, Any]:
    from mocca_robot.config import starter
    from mocca_robot.files.fields import UNITS_M

    size = float(f"{source.measure * UNITS_M[units] * share:.2g}")
    if source.kind == starter.SHELL:
        return {"kind": "shell", "surface": inside, "units": units, "thickness": size}
    return {"kind": "frame", "lines": inside, "units": units, "width": size, "height": size}


def _of_parts(
    name: str, source: Source, inside: str, folder: Path, units: str | None, console: Console
) -> tuple[str, Config, list[str]]:
    from mocca_robot.assembly import on_the_ground
    from mocca_robot.config import starter
    from mocca_robot.config.model import read_model

    model = read_model(source.path, units, None)
    parts = model.assembly.parts
    parts_from = {"model": inside, **({"units": units} if units else {})}
    chosen: dict[str, Any] = {}
    if len(parts) < 2:
        raise InputError(f"'{source.path}' holds one part; an assembly has at least a fixed and a free one.")
    if "fixed" not in model.given:
        chosen["fixed"] = on_the_ground(parts)
    fixed = chosen.get("fixed") or [p.name for p in parts if p.fixed]
    if "sequence" not in model.given:
        chosen |= {"sequence": starter.by_height(parts, fixed), "why": "from the lowest part up"}
    written = {k: v for k, v in chosen.items() if k != "why"}
    config, notes = _sound({**parts_from, **written}, folder)
    if "sequence" in chosen and len(parts) <= FEW and not notes:
        order = _searched(config.assembly)
        if order is None:
            notes.append("no order was found in which every part can go in; `mocca-robot sequence` says who bars whom")
        else:
            chosen |= {"sequence": [*fixed, *order], "why": "every part can go in"}
            config, notes = _sound({**parts_from, "fixed": fixed, "sequence": chosen["sequence"]}, folder)
    return starter.starter_yaml(name, parts_from, config.assembly, chosen | _allowed(config.assembly)), config, notes


def _allowed(assembly: Assembly) -> dict[str, float]:
    """Return the largest α that the contacts leave every part, in degrees, as 'allowed_deg'; {} where it is none."""
    from mocca_robot.motion.parts_graph import PartsGraph

    largest = min((motion.alpha_rad for _, motion in PartsGraph.of(assembly).motions()), default=0.0)
    allowed = math.degrees(largest)
    return {"allowed_deg": allowed} if allowed >= LEAST_ALPHA_DEG else {}


def _searched(assembly: Assembly) -> list[str] | None:
    """Return free parts in an order in which all of them go in, the present one if it does, or None.

    Within the α of the assembly or, where no order has that, within the least α.
    """
    from mocca_robot.motion.insertion import insertion_verdicts
    from mocca_robot.motion.parts_graph import PartsGraph
    from planners.order.sequence import find_sequence

    for alpha in (assembly.alpha_rad, math.radians(LEAST_ALPHA_DEG)):
        graph = PartsGraph.of(replace(assembly, alpha_rad=alpha))
        if all(i.assemblable for i in insertion_verdicts(graph)):
            return [p.name for p in assembly.parts if not p.fixed]
        found = find_sequence(graph, states=300)
        if found.placements:
            return [p.part for p in found.placements]
    return None


def _sound(data: dict[str, Any], folder: Path) -> tuple[Config, list[str]]:
    """Return what a configuration in `folder` comes to, and what its contacts leave to be desired."""
    import json

    from mocca_robot.config.config import load
    from mocca_robot.contacts.find import find_contacts, require_sound

    with tempfile.NamedTemporaryFile("w", suffix=".yaml", prefix=".new-", dir=folder, encoding="utf-8") as file:
        json.dump(data, file, ensure_ascii=False)
        file.flush()
        try:
            config = load(file.name)
        except InputError as error:
            raise InputError(str(error).replace(f"'{file.name}': ", "")) from None
    notes: list[str] = []
    report = find_contacts(config.assembly)
    for miss in report.near_misses[:8]:
        notes.append(f"'{miss.parts[0]}' and '{miss.parts[1]}' are {miss.gap_m * 1e3:.3g} mm apart; should they touch?")
    try:
        require_sound(config.assembly, report)
    except InputError as error:
        notes.append(f"not ready to run: {error}")
    return config, notes
