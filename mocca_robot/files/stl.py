"""STL, as text with named solids or binary."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.errors import InputError
from mocca_robot.files.documents import decoded

_HEADER = 84
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_SOLID = re.compile(r"^[ \t]*solid\b[ \t]*(.*)$", re.MULTILINE)
_VERTEX = re.compile(r"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")


def read_stl(path: Path) -> tuple[list[tuple[str, Array, IntArray]], str]:
    """Return the solids of a file, and a note on the encoding of their names, or ''.

    A solid is its name (empty where the file has none), corners (3F, 3) in the file's unit and triangles (F, 3).

    Raises InputError for files that are cut short or hold no triangle.
    """
    content = Path(path).read_bytes()
    count = int.from_bytes(content[80:_HEADER], "little") if len(content) >= _HEADER else -1
    head = decoded(content[:4096])[0].lstrip("\ufeff \t\r\n").lower()
    text_like = head.startswith("solid") and "facet" in head
    note = ""
    if count >= 0 and len(content) >= _HEADER + count * _RECORD.itemsize and not text_like:
        records = np.frombuffer(content, _RECORD, count, _HEADER)
        found = [("", records["corners"].astype(np.float64).reshape(-1, 3))]
    elif text_like:
        text, note = decoded(content)
        found = _solids(text, path)
    else:
        held = max(len(content) - _HEADER, 0) // _RECORD.itemsize
        raise InputError(
            f"{path} cannot be read as STL: it promises {max(count, 0):,} triangles and holds {held:,}. "
            "Export it again."
        )
    solids = [(name, v, np.arange(len(v)).reshape(-1, 3)) for name, v in found if len(v)]
    if not solids:
        raise InputError(f"{path} holds no triangles; export the part as a mesh again.")
    return solids, note


def _solids(text: str, path: Path) -> list[tuple[str, Array]]:
    starts = list(_SOLID.finditer(text))
    found = []
    for k, start in enumerate(starts):
        end = starts[k + 1].start() if k + 1 < len(starts) else len(text)
        try:
            numbers = np.array(_VERTEX.findall(text, start.end(), end), dtype=np.float64).reshape(-1, 3)
        except ValueError as error:
            raise InputError(f"{path} cannot be read as STL: {str(error)[:80]}. Export it again.") from None
        if len(numbers) % 3:
            raise InputError(f"{path}: the solid '{start[1].strip()[:60]}' ends in the middle of a triangle.")
        found.append((start[1].strip(), numbers))
    return found
