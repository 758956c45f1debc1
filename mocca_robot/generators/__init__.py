"""Parameters → assemblies: what designers start from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from mocca_robot.assembly import Assembly
from mocca_robot.errors import InputError, nearest
from mocca_robot.generators.blocks import arch, stack, wall
from mocca_robot.generators.dome import dome
from mocca_robot.generators.frame import frame
from mocca_robot.generators.shell import shell

KINDS: dict[str, Callable[[Mapping[str, Any], Path], Assembly]] = {
    "shell": shell,
    "frame": frame,
    "stack": stack,
    "wall": wall,
    "arch": arch,
    "dome": dome,
}


def generate(kind: str, parameters: Mapping[str, Any], folder: Path = Path(".")) -> Assembly:
    """Return the assembly that the generator `kind` makes; files among the parameters are relative to `folder`.

    All lengths are metres. Raises InputError for unknown kinds and parameters, with the nearest known one.
    """
    if kind not in KINDS:
        raise InputError(f"There is no generator '{kind}'; {nearest(str(kind), KINDS)}")
    return KINDS[kind](parameters, folder)
