"""What `check` understood of an input, in plain units: parts, sizes, masses, sequence; suspicions; a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.config.config import Config
from mocca_robot.contacts.find import CUT
from mocca_robot.contacts.inside import parts_inside
from mocca_robot.fabrication.bill import size
from mocca_robot.motion.parts_graph import PartsGraph

FEW = 40
"""Up to so many parts each gets a line of its own."""
TINY = 0.02
"""Contacts and parts below this share of the middle one are more often a slip than meant."""
SLENDER = 1e-3
"""Of its length, thickness of a part below which the unit may be wrong, or an outline is a part."""
HEAVY_KG = 50_000.0
"""Parts heavier than a mobile crane lifts."""
HOLLOW = 1e-3
"""Share of its bounding box that a part fills at least."""
DENSITIES = (5.0, 23000.0)
"""kg/m³, from foam to osmium."""


def plain_length(metres: float) -> str:
    """Return a length in the unit people would use for it."""
    if metres >= 1.0:
        return f"{metres:.3g} m"
    return f"{metres * 1e3:.3g} mm"


def plain_mass(kilograms: float) -> str:
    """Return a mass in grams, kilograms or tonnes."""
    if kilograms >= 1000.0:
        return f"{kilograms / 1e3:.3g} t"
    return f"{kilograms:.3g} kg" if kilograms >= 1.0 else f"{kilograms * 1e3:.3g} g"


def lines(config: Config, graph: PartsGraph) -> list[str]:
    """Return what was understood, for people."""
    assembly = config.assembly
    extent = np.ptp(np.concatenate([p.shape.bounds for p in assembly.parts]), axis=0)
    edges = " × ".join(plain_length(float(v)) for v in extent)
    names = ("wide", "high") if assembly.dimension == 2 else ("x", "y", "z")
    out = [f"read: {config.source} in {config.unit}; {edges} ({' × '.join(names)})"]
    if len(assembly.parts) <= FEW:
        for k, part in enumerate(assembly.parts):
            edges = " × ".join(plain_length(v) for v in size(part))
            fixed = ", fixed" if part.fixed else ""
            touches = ", ".join(assembly.parts[n].name for n in graph.neighbours(k)) or "nothing"
            out.append(f"{k + 1:3}  {part.name}: {edges}, {plain_mass(part.mass)}{fixed}; touches {touches}")
    else:
        shown = [p.name for p in assembly.parts[:FEW]]
        out.append(f"sequence: {', '.join(shown)} and {len(assembly.parts) - FEW} more")
    return out


def nested(graph: PartsGraph) -> list[str]:
    """Return which parts lie inside others, and what to do about it: said before an error that it may explain."""
    parts = graph.assembly.parts
    return [
        f"'{parts[inner].name}' lies inside '{parts[outer].name}' and touches it nowhere; is it a leftover or a copy? "
        f"Delete it, or make it touch what holds it. {CUT}"
        for inner, outer in parts_inside(graph.assembly, graph.contacts)
    ][:12]


def suspicions(graph: PartsGraph) -> list[str]:
    """Return what is sound but more often a slip than meant."""
    assembly, contacts = graph.assembly, graph.contacts
    out = []
    for part in assembly.parts:
        if not DENSITIES[0] <= part.density <= DENSITIES[1]:
            out.append(
                f"'{part.name}' has a density of {part.density:g} kg/m³; is that meant? (water 1000, steel 7850)"
            )
    volumes = np.array([p.shape.volume for p in assembly.parts])
    for part in assembly.parts:
        edges = sorted(size(part))
        if edges[0] < SLENDER * edges[-1]:
            out.append(
                f"'{part.name}' is {plain_length(edges[-1])} long and {plain_length(edges[0])} thin; is that meant? "
                "Is its unit right, and is it one part?"
            )
        if part.mass > HEAVY_KG:
            out.append(f"'{part.name}' weighs {plain_mass(part.mass)}; is the unit right? ('units', 'scale')")
        if part.shape.volume < HOLLOW * float(np.prod(edges)):
            share = part.shape.volume / float(np.prod(edges))
            out.append(f"'{part.name}' fills {share:.1g} of its bounding box; is a surface without thickness among it?")
    for k in np.flatnonzero(volumes < TINY**assembly.dimension * np.median(volumes)):
        share = volumes[k] / np.median(volumes)
        out.append(f"'{assembly.parts[k].name}' is tiny: {share:.1g} of the middle part's volume; a leftover?")
    measures = np.array([c.measure for c in contacts])
    for k in np.flatnonzero(measures < TINY ** (assembly.dimension - 1) * np.median(measures)) if len(contacts) else ():
        a, b = (assembly.parts[p].name for p in contacts[k].parts)
        unit = f"{measures[k] * 1e3:.3g} mm" if assembly.dimension == 2 else f"{measures[k] * 1e6:.3g} mm²"
        out.append(f"'{a}' and '{b}' touch over {unit} only; should they?")
    up = assembly.gravity[-1] > 0.0
    if up:
        out.append("gravity points up; is that meant?")
    lowest = min(float(p.shape.bounds[0, -1]) for p in assembly.parts)
    for part in assembly.parts:
        above = float(part.shape.bounds[0, -1]) - lowest
        if part.fixed and above > 0.5 * assembly.size:
            out.append(
                f"'{part.name}' is fixed, {plain_length(above)} above the lowest point; does it touch the ground?"
            )
    return out[:12]


def document(config: Config) -> dict[str, Any]:
    """Return the same for JSON, in metres and kilograms."""
    return {
        "source": str(config.source),
        "unit": config.unit,
        "sizes_m": {p.name: list(size(p)) for p in config.assembly.parts},
        "sequence": list(config.assembly.sequence),
    }


def write_picture(path: Path, graph: PartsGraph) -> Path:
    """Return `path` after drawing the parts there, .svg or .png. Raises InputError for other endings."""
    from mocca_robot.report import figures
    from mocca_robot.report.palette import part_colours
    from mocca_robot.report.pictures import Picture, draw, shared_view

    view = shared_view([graph.assembly], 600.0)
    svg = draw(Picture(graph=graph, colours=part_colours(graph)), view, graph.assembly.name)
    return figures.write_picture(figures.stand_alone(svg), path)
