"""Names for content: equal inputs and options have equal hashes, so that finished work is found again."""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from mocca_robot.assembly import Assembly, Polygon


def content_hash(content: tuple[Any, ...]) -> str:
    """Return a hash of plain values, arrays and dataclasses of these; equal content gives equal hashes."""
    return hashlib.sha256(json.dumps(_plain(content), sort_keys=True).encode()).hexdigest()


def assembly_hash(assembly: Assembly) -> str:
    """Return a hash of the geometry, masses and order of the parts."""
    digest = hashlib.sha256()
    for part in assembly.parts:
        named = (part.material,) if part.material else ()
        digest.update(repr((part.name, part.density, part.fixed, *named)).encode())
        shape = part.shape
        arrays = (
            (*shape.rings, np.array(shape.thickness)) if isinstance(shape, Polygon) else (shape.vertices, shape.faces)
        )
        for array in arrays:
            digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(np.ascontiguousarray(assembly.gravity).tobytes())
    return digest.hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, float) and type(value) is not float:  # a number that says more, such as a table of friction
        return [_plain(v) for v in value.__reduce__()[1]]
    if is_dataclass(value) and not isinstance(value, type):
        return [type(value).__name__, *[_plain(getattr(value, f.name)) for f in fields(value)]]
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(v) for v in value]
    return value
