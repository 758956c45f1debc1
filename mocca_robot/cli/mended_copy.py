"""`check --heal`: a copy of an input in which neighbours share their faces exactly, ready for `design`."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import positive_if
from mocca_robot.config.config import Config
from mocca_robot.contacts.contact import Accepted, ContactReport
from mocca_robot.errors import InputError, NearlyTouching
from mocca_robot.tolerances import TOLERANCES

SHOWN = 12
"""Pairs that are listed one by one."""
BY_HAND = (
    "where each part cuts a curved face into flats of its own, give both the same ones: cut the later part with the "
    "earlier (in Rhino: BooleanDifference, before meshing; in Blender: the modifier Boolean, Difference; in FreeCAD: "
    "Part, Cut; in Inkscape: Path, Difference), and export both again"
)
"""What to do about pairs that cannot be mended here."""
IN_THE_PARTS = (
    *("model", "generator", "units", "scale", "up", "rigid", "tolerance", "fixed", "sequence", "name", "density"),
    *("thickness", "material", "gravity", "goal", "alpha_deg", "loads", "combinations", "version"),
)
"""Keys that the written assembly says itself."""


def advice(error: NearlyTouching, args: argparse.Namespace) -> str:
    """Return the commands that help: one that looks at the parts as they are, one that writes a mended copy."""
    given = [word for text in getattr(args, "set", []) if not text.startswith("tolerance=") for word in ("--set", text)]
    words = ["mocca-robot", "check", str(args.input), *given, "--set", f"tolerance={error.tolerance_m * 1e3:.6g} mm"]
    command = shlex.join(words)
    return (
        f"If they should touch, `{command}` says how they stand as they are, and with --heal it writes a mended copy."
    )


def accepted_lines(accepted: Sequence[Accepted]) -> list[str]:
    """Return what was taken as touching, the deepest first."""
    worst = sorted(accepted, key=lambda a: -max(a.overlap_m, a.gap_m))
    out = [f"taken as touching: '{a.parts[0]}' and '{a.parts[1]}', {_amount(a)}" for a in worst[:SHOWN]]
    return out + ([f"taken as touching: {len(worst) - SHOWN} more pairs by less"] if len(worst) > SHOWN else [])


def accepted_data(accepted: Sequence[Accepted]) -> list[dict[str, Any]]:
    """Return the same for JSON."""
    return [{"parts": list(a.parts), "overlap_m": a.overlap_m, "gap_m": a.gap_m} for a in accepted]


def _amount(pair: Accepted) -> str:
    amounts = (("{:.3g} mm inside each other", pair.overlap_m), ("{:.3g} mm apart", pair.gap_m))
    return " and ".join(words.format(m * 1e3) for words, m in amounts if m > 0.0)


def write_healed(config: Config, report: ContactReport, folder: Path, console: Console) -> int:
    """Return 0 after writing the mended copy into `folder`, 1 where parts still overlap or miss each other."""
    from mocca_robot.contacts.healing import heal
    from mocca_robot.files.assembly_json import write_assembly
    from mocca_robot.files.documents import yaml_text
    from mocca_robot.files.output import make_folder, safe_file_names, write_atomic

    make_folder(folder)
    assembly = replace(config.assembly, tolerance_m=_tolerance(config, report))
    with console.stage("heal"):
        healed = heal(assembly)
    stem = safe_file_names([assembly.name])[assembly.name]
    model = write_assembly(healed.assembly, folder / f"{stem}.json")
    target = write_atomic(folder / f"{stem}.yaml", yaml_text(_configuration(config, model)))
    moved = max(zip(healed.moved_m, assembly.sequence))
    changed = max((abs(v), v, name) for v, name in zip(healed.volume_change, assembly.sequence))
    console.say(
        f"healed within {assembly.tolerance_m * 1e3:.3g} mm: corners moved by at most {moved[0] * 1e3:.3g} mm "
        f"('{moved[1]}'), volumes changed by at most {abs(changed[1]):.2g} of a part ('{changed[2]}')"
    )
    for a, b in healed.cut[:SHOWN]:
        console.say(f"cut: what '{a}' and '{b}' still shared, from the later one")
    for pair in healed.left[:SHOWN]:
        console.say(f"✗ not mended: '{pair.parts[0]}' and '{pair.parts[1]}' are still {_amount(pair)}; {BY_HAND}")
    console.say(str(target))
    console.say(
        f"next: mocca-robot check {shlex.quote(str(target))}, then mocca-robot design {shlex.quote(str(target))}"
    )
    data = {
        "files": [str(target), str(model)],
        "tolerance_m": assembly.tolerance_m,
        "moved_m": dict(zip(assembly.sequence, healed.moved_m)),
        "volume_change": dict(zip(assembly.sequence, healed.volume_change)),
        "cut": [list(pair) for pair in healed.cut],
        "left": accepted_data(healed.left),
    }
    return console.finish(positive_if(not healed.left), data)


def _tolerance(config: Config, report: ContactReport) -> float:
    """Return the tolerance that was given, else the least within which the parts touch."""
    from mocca_robot.contacts.find import largest_tolerance, require_sound, rounded_up

    if config.assembly.tolerance_m > 0.0:
        return config.assembly.tolerance_m
    gaps = [n.gap_m for n in report.near_misses]
    found = rounded_up(1.05 * max(gaps)) if gaps else 0.0
    try:
        require_sound(config.assembly, report)
    except NearlyTouching as error:
        found = max(found, error.tolerance_m)
    if found == 0.0:
        raise InputError(f"Nothing of '{config.assembly.name}' nearly touches: there is nothing to heal.")
    # What rounding explains anyway is mended with it.
    found = max(found, rounded_up(TOLERANCES.overlap_depth * config.assembly.size))
    if found > largest_tolerance(config.assembly)[0]:
        raise InputError(
            f"Parts of '{config.assembly.name}' are {max(gaps) * 1e3:.3g} mm apart, which is much beside its thinnest "
            "part; say with --set tolerance='0.1 mm' how much is to be mended."
        )
    return found


def _configuration(config: Config, model: Path) -> dict[str, Any]:
    """Return the configuration of the mended copy: what was set for the input and its parts do not say."""
    from mocca_robot.config.schema import KEYS

    kinds = {k.name: k for k in KEYS}
    data: dict[str, Any] = {"model": model.name}
    for value in config.values:
        key = kinds.get(value.key)
        if key is None or value.key in IN_THE_PARTS or value.origin not in ("argument", "configuration"):
            continue
        written = value.value
        if key.kind == "length" and key.unit == "units" and not isinstance(written, str):
            written = f"{written} {config.unit}"
        section, _, last = value.key.rpartition(".")
        (data.setdefault(section, {}) if section else data)[last] = written
    return data
