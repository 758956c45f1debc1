"""strength.html: what share of their strength parts and joints use, as a page of its own."""

from __future__ import annotations

from pathlib import Path

from mocca_robot.assembly import Assembly
from mocca_robot.files.output import write_atomic
from mocca_robot.report.markup import esc
from mocca_robot.report.page import document
from mocca_robot.report.strength import strength_section
from mocca_robot.strength.uses import AssemblyStrength


def write_strength_page(path: Path, assembly: Assembly, found: AssemblyStrength, unit: str, unit_m: float) -> Path:
    """Return `path` after writing a page with the section about strength alone; places in `unit` of `unit_m` metres."""
    header = f'<header class="top"><h1>{esc(assembly.name)}</h1><p class="mute">Will it break?</p></header>'
    return write_atomic(path, document(assembly.name, header, strength_section(assembly, found, unit, unit_m), []))
