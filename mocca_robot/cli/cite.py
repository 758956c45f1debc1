"""`mocca-robot cite`: BibTeX of this program, the method and the physics engine."""

from __future__ import annotations

import argparse
from typing import Any

from mocca_robot.cli import arguments
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode
from mocca_robot.cli.info import own_version

ENTRIES: dict[str, tuple[str, dict[str, str]]] = {
    "mocca_robot": (
        "misc",
        {
            "title": "{mocca-robot}: cone joints for structures that stand without glue, screws or friction",
            "author": "{the mocca-robot authors}",
            "note": "Software, version VERSION",
        },
    ),
    "wang2021mocca": (
        "article",
        {
            "title": "{MOCCA}: Modeling and Optimizing Cone-joints for Complex Assemblies",
            "author": "Wang, Ziqi and Song, Peng and Pauly, Mark",
            "journal": "ACM Transactions on Graphics",
            "volume": "40",
            "number": "4",
            "year": "2021",
            "doi": "10.1145/3450626.3459680",
        },
    ),
    "todorov2012mujoco": (
        "inproceedings",
        {
            "title": "{MuJoCo}: A physics engine for model-based control",
            "author": "Todorov, Emanuel and Erez, Tom and Tassa, Yuval",
            "booktitle": "IEEE/RSJ International Conference on Intelligent Robots and Systems",
            "year": "2012",
            "doi": "10.1109/IROS.2012.6386109",
        },
    ),
}
"""Key → kind and fields: the program, the method of its joints, the engine of `simulate`."""


def add(commands: Any) -> None:
    """Add the command."""
    text = "print BibTeX of this program, of the method and of the physics engine"
    parser: argparse.ArgumentParser = commands.add_parser("cite", help=text, description=text)
    arguments.add_json(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Return 0 after printing the entries."""
    console = Console(args.json)
    found = {key: bibtex(key) for key in ENTRIES}
    console.say("\n\n".join(found.values()))
    return console.finish(ExitCode.POSITIVE, {"bibtex": found})


def bibtex(key: str) -> str:
    """Return one entry as BibTeX."""
    kind, values = ENTRIES[key]
    lines = [f"  {name} = {{{value.replace('VERSION', own_version())}}}" for name, value in values.items()]
    return f"@{kind}{{{key},\n" + ",\n".join(lines) + "\n}"
