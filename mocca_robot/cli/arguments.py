"""Arguments that several commands share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from mocca_robot.cli.console import Console
from mocca_robot.errors import InputError


def add_input(parser: argparse.ArgumentParser, what: str = "CONFIG") -> None:
    """Add the input file and `--set`."""
    parser.add_argument(
        "input",
        metavar=what,
        help="YAML configuration, assembly .json, design.json, .svg or .dxf drawing, mesh file or folder of meshes",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="override a key of the configuration, such as alpha_deg=10 or joints.margin=0.1; may be repeated",
    )


def add_output(parser: argparse.ArgumentParser) -> None:
    """Add the output folder."""
    parser.add_argument("-o", "--output", metavar="DIR", help="folder for the results (default: out/NAME)")


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add `--json`."""
    parser.add_argument("--json", action="store_true", help="print one JSON object on stdout, nothing else")


def load(args: argparse.Namespace, further: dict[str, Any] | None = None) -> Any:
    """Return the Config of the input with its overrides; `further` keys win over all."""
    from mocca_robot.config.config import load as load_config

    return load_config(args.input, {**overrides(args.set), **(further or {})})


def read(args: argparse.Namespace, console: Console, further: dict[str, Any] | None = None) -> Any:
    """Return the same as a stage of a command, after its notes were told: repairs, and what is more often a slip."""
    with console.stage("read"):
        config = load(args, further)
    for note in config.notes:
        console.warn(f"note: {note}")
    return config


def overrides(assignments: list[str]) -> dict[str, Any]:
    """Return configuration keys from 'key=value' texts; values are YAML, 'section.key' makes a section."""
    from mocca_robot.files.documents import parse_yaml

    found: dict[str, Any] = {}
    for text in assignments:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise InputError(f"--set {text}: write KEY=VALUE, such as --set alpha_deg=10.")
        parsed = parse_yaml(value, f"--set {text}")
        *sections, last = key.strip().split(".")
        inside = found
        for section in sections:
            inside = inside.setdefault(section, {})
            if not isinstance(inside, dict):
                raise InputError(f"--set {text}: '{section}' was set to a value before; it cannot hold '{last}' too.")
        inside[last] = parsed
    return found


def prepare_output(args: argparse.Namespace, name: str) -> Path:
    """Create the folder for results and return it, known to take files before any work starts."""
    from mocca_robot.files.output import make_folder, safe_file_names

    return make_folder(args.output if args.output is not None else Path("out") / safe_file_names([name])[name])
