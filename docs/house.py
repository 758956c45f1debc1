"""The house: its rooms, floor by floor, who imports whom, and a picture of it drawn from that.

`tests/project/test_architecture.py` holds the code to `FLOORS`; `docs/generate.py` draws the picture on the page about
the architecture.
"""

from __future__ import annotations

import ast
import re
import textwrap
from collections import defaultdict
from collections.abc import Iterable
from html import escape
from itertools import pairwise
from pathlib import Path

import networkx as nx

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("mocca_robot", "planners", "sim")

FLOORS = (
    ("mocca_robot.actions", "mocca_robot.errors", "mocca_robot.arrays", "mocca_robot.tolerances"),
    ("mocca_robot.assembly",),
    ("mocca_robot.geometry", "mocca_robot.runtime"),
    ("mocca_robot.contacts", "mocca_robot.statics.solver"),
    ("mocca_robot.joints",),
    ("mocca_robot.design", "mocca_robot.motion"),
    ("mocca_robot.files", "mocca_robot.statics"),
    (
        "mocca_robot.fabrication",
        "mocca_robot.generators",
        "mocca_robot.plan",
        "mocca_robot.strength",
        "mocca_robot.verdicts",
    ),
    ("mocca_robot.config", "mocca_robot.report", "mocca_robot.ur"),
    ("planners", "mocca_robot"),
    ("sim",),
    ("mocca_robot.cli",),
)
"""The rooms of the house, floor by floor: a room imports only from floors below its own."""

LINE = {
    "mocca_robot.files": "1 read",
    "mocca_robot.contacts": "2 contacts",
    "mocca_robot.motion": "3 motion",
    "mocca_robot.statics": "4 statics",
    "mocca_robot.joints": "5 joints",
    "planners": "6 design · 8 plan",
    "mocca_robot.verdicts": "7 verify",
    "mocca_robot.ur": "9 execute",
}
"""Where each step from parts to a robot's motion happens."""

WIDTH, HEIGHT, GAP, MARGIN, PASSAGE, WIDEST = 960, 92, 34, 14, 20, 440
SWEEPS = 24


def modules() -> dict[str, Path]:
    """Return every module of the product by its full name."""
    paths = sorted(p for package in PACKAGES for p in (ROOT / package).rglob("*.py"))
    return {".".join(p.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): p for p in paths}


def imports() -> dict[str, set[str]]:
    """Return which modules every module imports, also inside functions; a name that is a module counts as that."""
    known = modules()
    found: dict[str, set[str]] = {}
    for name, path in known.items():
        found[name] = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in PACKAGES:
                found[name] |= {f"{node.module}.{a.name}" for a in node.names} & set(known) or {str(node.module)}
            elif isinstance(node, ast.Import):
                found[name] |= {a.name for a in node.names} & set(known)
    return found


def room_of(module: str) -> str:
    """Return the room of a module: its place in `FLOORS`, the longest name that fits."""
    fitting = [room for floor in FLOORS for room in floor if module == room or module.startswith(f"{room}.")]
    assert fitting, f"{module} is in no room; give it one in FLOORS of docs/house.py, above all that it imports"
    return max(fitting, key=len)


def picture() -> str:
    """Return the house as an SVG: a box per room, lines to the rooms that it needs.

    A line that follows from two others (a room needs b, b needs c) is left out.
    """
    needs: nx.DiGraph[str] = nx.DiGraph()
    needs.add_nodes_from(room for floor in FLOORS for room in floor)
    pairs = {(room_of(name), room_of(target)) for name, targets in imports().items() for target in targets}
    needs.add_edges_from((a, b) for a, b in sorted(pairs) if a != b)
    lines = nx.transitive_reduction(needs)
    rows, paths = _rows(lines.edges)
    boxes = _boxes(rows)
    height = len(rows) * (HEIGHT + GAP) - GAP + 2 * MARGIN
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
        'font-family="Helvetica, Arial, sans-serif" font-size="12.5">',
        "<title>The rooms of mocca-robot, floor by floor, and which of them need which</title>",
        f'<rect width="{WIDTH}" height="{height}" fill="#fff"/>',
    ]
    out += [_line([boxes[place] for place in path]) for path in paths]
    out += [_room(room, boxes[room]) for row in rows for room in row if room in needs]
    return "\n".join([*out, "</svg>"]) + "\n"


def _rows(edges: Iterable[tuple[str, str]]) -> tuple[list[list[str]], list[list[str]]]:
    """Return what stands on every floor from left to right, lowest first, and the places that every line passes.

    A line across several floors gets a narrow passage on each in between. The order on a floor is that of the means of
    the neighbours' places, swept up and down.
    """
    floor = {room: height for height, rooms in enumerate(FLOORS) for room in rooms}
    rows = [list(rooms) for rooms in FLOORS]
    paths = []
    for upper, lower in sorted(edges):
        between = [(height, f"{upper}|{lower}|{height}") for height in range(floor[upper] - 1, floor[lower], -1)]
        for height, passage in between:
            rows[height].append(passage)
        paths.append([upper, *(passage for _, passage in between), lower])
    beside: dict[str, set[str]] = defaultdict(set)
    for path in paths:
        for above, below in pairwise(path):
            beside[above].add(below)
            beside[below].add(above)
    for sweep in range(SWEEPS):
        for height in range(len(rows)) if sweep % 2 else reversed(range(len(rows))):
            middles = {place: x + width / 2 for place, (x, _, width) in _boxes(rows).items()}
            rows[height].sort(key=lambda place: _mean([middles[n] for n in beside[place]] or [middles[place]]))
    return rows, paths


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)


def _boxes(rows: list[list[str]]) -> dict[str, tuple[float, float, float]]:
    """Return left, top and width of every room and passage; the first row lies at the bottom."""
    found = {}
    for height, row in enumerate(rows):
        rooms = sum("|" not in place for place in row)
        fixed = PASSAGE * (len(row) - rooms) + MARGIN * (rooms - 1)
        box = min((WIDTH - 2 * MARGIN - fixed) / rooms, WIDEST)
        left, top = (WIDTH - box * rooms - fixed) / 2, MARGIN + (len(rows) - 1 - height) * (HEIGHT + GAP)
        for place in row:
            width = PASSAGE if "|" in place else box
            found[place] = (left, float(top), width)
            left += width + (0 if "|" in place else MARGIN)
    return found


def _line(boxes: list[tuple[float, float, float]]) -> str:
    """Return a curve from the foot of the first box through the passages to the top of the last."""
    (x, top, width), rest = boxes[0], boxes[1:]
    x, y = x + width / 2, top + HEIGHT
    path = [f"M {x:.0f} {y:.0f}"]
    for left, top, wide in rest:
        to, bend = left + wide / 2, (top + y) / 2
        path.append(f"C {x:.0f} {bend:.0f} {to:.0f} {bend:.0f} {to:.0f} {top:.0f} V {top + HEIGHT:.0f}")
        x, y = to, top + HEIGHT
    return f'<path d="{" ".join(path)}" fill="none" stroke="#90a4ae" stroke-width="1.6"/>'


def _room(room: str, box: tuple[float, float, float]) -> str:
    """Return a room's box: its place in the code, its step on the line if it has one, and what it says it is."""
    left, top, width = box
    path = modules()[room]
    folder = path.parent if path.name == "__init__.py" else path
    name = folder.relative_to(ROOT).as_posix() + ("/" if folder.is_dir() else "")
    fill, edge = ("#e0f2f1", "#00796b") if room in LINE else ("#fafafa", "#b0bec5")
    out = [
        f'<rect x="{left:.0f}" y="{top:.0f}" width="{width:.0f}" height="{HEIGHT}" rx="6" '
        f'fill="{fill}" stroke="{edge}"/>',
        f'<text x="{left + 12:.0f}" y="{top + 20:.0f}" font-weight="bold">{name}</text>',
    ]
    if room in LINE:
        out.append(
            f'<text x="{left + width - 12:.0f}" y="{top + 20:.0f}" text-anchor="end" fill="#00695c">{LINE[room]}</text>'
        )
    words = textwrap.wrap(_meaning(path), int((width - 24) / 6), max_lines=4, placeholder=" …")
    inner = sorted(p.parent.name for p in folder.glob("*/__init__.py")) if room in ("planners", "sim") else []
    for row, line in enumerate([*words, *([" · ".join(inner)] if inner else [])]):
        out.append(f'<text x="{left + 12:.0f}" y="{top + 37 + 15 * row:.0f}" fill="#455a64">{escape(line)}</text>')
    return "\n".join(out)


def _meaning(path: Path) -> str:
    """Return the first sentence of a module's docstring."""
    text = " ".join((ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n\n")[0].split())
    return re.split(r"\. (?=[A-Z])", text)[0].rstrip(".").replace("`", "")
