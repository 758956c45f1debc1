"""`mocca-robot config show`: every value that a run would use, and who said so."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode

if TYPE_CHECKING:
    from mocca_robot.config.config import Config, EffectiveValue

DESCRIPTION = """Prints every key with the value that a run would use and where it comes from: a line of the file,
--set, the model itself, or the default. The output is YAML, ready to be used as a configuration."""


def add(commands: Any) -> None:
    """Add the command with its one subcommand."""
    text = "show what a configuration amounts to"
    inner = commands.add_parser("config", help=text, description=text).add_subparsers(metavar="WHAT", required=True)
    parser: argparse.ArgumentParser = inner.add_parser(
        "show", help="print every effective value and where it comes from", description=DESCRIPTION
    )
    arguments.add_input(parser, "FILE")
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 after printing the values."""
    console = Console(args.json)
    config = arguments.read(args, console)
    values = [(v.key, _value(v, config), _source(v, config)) for v in config.values]
    for line in _lines(values):
        console.say(line)
    return console.finish(ExitCode.POSITIVE, {"values": [dict(zip(("key", "value", "source"), v)) for v in values]})


def _source(value: EffectiveValue, config: Config) -> str:
    """Return who said it: '--set', 'FILE:LINE', the model's file, or 'default'."""
    if value.origin == "argument":
        return "--set"
    if value.origin == "configuration":
        return f"{config.source.name}:{value.line}" if value.line else config.source.name
    if value.origin == "model":
        named = next((v.value for v in config.values if v.key == "model" and v.value), None)
        return Path(str(named)).name if named else "generator"
    return "default"


def _value(value: EffectiveValue, config: Config) -> Any:
    """Return a value as it was written, or as the model and the defaults make it where nobody wrote it."""
    if value.origin in ("argument", "configuration"):
        return value.value
    from mocca_robot.files.goals import degrees, goals_to_data

    assembly = config.assembly
    alpha = assembly.alpha_rad
    derived: dict[str, Any] = {
        "name": assembly.name,
        "units": config.unit,
        "fixed": [p.name for p in assembly.parts if p.fixed],
        "sequence": list(assembly.sequence),
        "goal": goals_to_data(assembly.goals),
        "alpha_deg": None if alpha is None else degrees(alpha),
        "gravity": assembly.gravity.tolist(),
        "insertion": {name: way.tolist() for name, way in config.insertion.items()} or None,
        **({"friction": float(config.friction)} if value.origin == "default" else {}),
        "simulate.friction": config.simulate.friction,
    }
    return derived.get(value.key, value.value)


def _lines(values: list[tuple[str, Any, str]]) -> list[str]:
    """Return YAML, the sources as comments in one column."""
    from mocca_robot.files.documents import yaml_text

    rows: list[tuple[str, str]] = []
    path: list[str] = []
    for key, value, source in values:
        *sections, last = _path(key)
        if sections != path:
            kept = len([1 for a, b in zip(sections, path) if a == b])
            rows += [(f"{'  ' * k}{yaml_text(sections[k])}:", "") for k in range(kept, len(sections))]
            path = sections
        rows.append((f"{'  ' * len(sections)}{yaml_text(last)}: {yaml_text(value)}", source))
    width = min(max((len(left) for left, _ in rows), default=0), 60)
    return [f"{left:{width}}  # {source}" if source else left for left, source in rows]


def _path(key: str) -> list[str]:
    """Return the sections and the last name of a key; a part's name may hold dots."""
    if not key.startswith("parts."):
        return key.split(".")
    name, _, last = key.removeprefix("parts.").rpartition(".")
    return ["parts", name, last]
