"""Closed meshes in OBJ, STL, PLY, 3MF, GLB, STEP and 3DM files → parts."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.errors import InputError, nearest
from mocca_robot.files.bodies import MeshObject, NamedMesh, parts_of
from mocca_robot.files.fields import LARGEST
from mocca_robot.files.mending import repaired

METRES_PER = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
FORMATS = ("obj", "stl", "ply", "3mf", "glb", "3dm")
"""Those that are written, too."""
READ = (*FORMATS, "step", "stp")
SMALLEST_PART_M, LARGEST_M = 5e-4, 500.0
"""Sizes outside are more often a wrong unit than a real structure."""
LARGEST_FILE = 256 * 1024 * 1024
"""Bytes of one file; ten million triangles are far more than a part needs."""

Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""glTF has y up; here z is."""


def read_parts(
    path: Path, units: str | None = None, *, any_size: bool = False, rigid: Collection[str] = ()
) -> list[NamedMesh]:
    """Return closed, outward parts from a file or a folder of files.

    Every closed body is a part, named by its object in the file, by its group in it, or by the file, and numbered where
    one name has several; those of a name in `rigid` stay one part. In a folder the file stems are the names, in natural
    order (2 before 10). `units` is a key of `METRES_PER`; 3MF, GLB, STEP and 3DM files declare their own, for all
    others it has to be given. Raises InputError for open meshes, unknown units and sizes that look like a wrong unit
    (unless `any_size`).
    """
    path = Path(path)
    if path.is_dir():
        files = [f for f in path.iterdir() if f.suffix.lower()[1:] in READ]
        if not files:
            raise InputError(f"Folder '{path}' holds no mesh; expected files ending in {', '.join(READ)}.")
        objects = [_merged(f, units) for f in sorted(files, key=lambda f: _natural(f.stem))]
    else:
        objects = _objects(path, units)
    try:
        parts = parts_of(objects, rigid)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    if not any_size:
        _check_scale(parts, path)
    return parts


def read_mesh(path: Path, units: str | None = None) -> NamedMesh:
    """Return the one part of a mesh file, named after the file; all bodies in it belong to the part."""
    path = Path(path)
    whole = _merged(path, units)
    try:
        mesh, notes = repaired(path.stem, whole.vertices, whole.triangles)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return NamedMesh(path.stem, mesh, notes)


def _merged(path: Path, units: str | None) -> MeshObject:
    """Return all objects of a file as one, named after it; each keeps its name as that of a group."""
    objects = _objects(path, units)
    offset = np.cumsum([0] + [len(o.vertices) for o in objects])
    return MeshObject(
        path.stem,
        np.concatenate([o.vertices for o in objects]),
        np.concatenate([o.triangles + k for o, k in zip(objects, offset)]),
        [o.name for o in objects for _ in o.triangles] if len(objects) > 1 else objects[0].groups,
        tuple(dict.fromkeys(n for o in objects for n in o.notes)),
    )


def _check_scale(parts: Sequence[NamedMesh], path: Path) -> None:
    bounds = np.array([p.mesh.bounds for p in parts])
    whole = float(np.ptp(bounds.reshape(-1, 3), axis=0).max())
    sizes = np.linalg.norm(bounds[:, 1] - bounds[:, 0], axis=1)
    smallest = int(sizes.argmin())
    remedy = f"check 'units' (one of {', '.join(METRES_PER)}); if this size is meant, write 'scale: 1'"
    if whole > LARGEST_M:
        raise InputError(f"{path}: the model is {whole:,.0f} m across, the limit is {LARGEST_M:g} m; {remedy}.")
    if sizes[smallest] < SMALLEST_PART_M:
        raise InputError(
            f"{path}: part '{parts[smallest].name}' is only {sizes[smallest] * 1e3:.3g} mm across, the limit is "
            f"{SMALLEST_PART_M * 1e3:g} mm; {remedy}."
        )


def _natural(stem: str) -> list[tuple[int, int, str]]:
    import re

    return [(0, int(s), "") if s.isdigit() else (1, 0, s) for s in re.split(r"(\d+)", stem) if s]


def _factor(path: Path, units: str | None, declared: float | None = None) -> float:
    """Return metres per unit of a file: as its reader is told, else as the file declares."""
    if units is None and declared is not None:
        return declared
    if units is None:
        raise InputError(
            f"{path}: {path.suffix[1:].upper()} files carry no unit; give 'units' (one of {', '.join(METRES_PER)})."
        )
    if units not in METRES_PER:
        raise InputError(f"Unknown unit '{units}'; {nearest(units, METRES_PER)}")
    return METRES_PER[units]


def _objects(path: Path, units: str | None) -> list[MeshObject]:
    """Return the objects of a file, in metres, every number of a size that can be worked with."""
    found = _objects_as_written(path, units)
    for thing in found:
        if not (np.abs(thing.vertices) < LARGEST).all():
            raise InputError(
                f"{path}: '{thing.name}' has coordinates that are no numbers, or too large; export it again."
            )
    return found


def _objects_as_written(path: Path, units: str | None) -> list[MeshObject]:
    suffix = path.suffix.lower()[1:]
    if not path.is_file():
        raise InputError(f"Mesh file '{path}' does not exist.")
    if suffix not in READ:
        raise InputError(f"'{path}' ends in '.{suffix}'; known mesh formats: {', '.join(READ)}.")
    _require_modest(path, suffix)
    if suffix == "obj":
        from mocca_robot.files.obj import read_obj

        factor = _factor(path, units)
        objects = []
        for thing in (o for o in read_obj(path) if o.faces):
            triangles, owner = thing.triangles()
            groups = [thing.groups[k] for k in owner.tolist()] if any(thing.groups) else ()
            notes = (thing.note,) if thing.note and not thing.name.isascii() else ()
            objects.append(MeshObject(thing.name or path.stem, thing.vertices * factor, triangles, groups, notes))
        return objects
    if suffix == "stl":
        from mocca_robot.files.stl import read_stl

        factor = _factor(path, units)
        solids, note = read_stl(path)
        notes = (note,) if note else ()
        return [MeshObject(name or path.stem, v * factor, f, (), notes) for name, v, f in solids]
    if suffix == "ply":
        from mocca_robot.files.ply import read_ply

        vertices, faces, _ = read_ply(path)
        return [MeshObject(path.stem, vertices * _factor(path, units), faces)]
    if suffix == "3dm":
        from mocca_robot.files.rhino import read_3dm

        things, unit = read_3dm(path)
        factor = _factor(path, units, unit)
        return [replace(o, name=o.name or path.stem, vertices=o.vertices * factor) for o in things]
    return [MeshObject(name or path.stem, v, f) for name, v, f in _declaring(path, suffix, units)]


def _declaring(path: Path, suffix: str, units: str | None) -> list[tuple[str, Array, IntArray]]:
    """Return names, vertices in metres, z up, and triangles of a file that declares its unit."""
    if suffix == "3mf":
        from mocca_robot.files.threemf import read_threemf

        pieces, unit = read_threemf(path)
        factor = _factor(path, units, METRES_PER[unit])
        return [(name, v * factor, f) for name, v, f in pieces]
    if suffix == "glb":
        from mocca_robot.files.glb import read_glb

        factor = _factor(path, units, 1.0)
        return [(name, (v @ Z_UP[:3, :3].T) * factor, f) for name, v, f in read_glb(path.read_bytes(), f"'{path}'")]
    from mocca_robot.files.step import read_step

    if units is not None:
        raise InputError(f"'{path}' is a STEP file and says its unit itself; remove 'units: {units}'.")
    return read_step(path)


def _require_modest(path: Path, suffix: str) -> None:
    """Raise InputError when a file, or what a 3MF unpacks to, is larger than `LARGEST_FILE`."""
    import zipfile

    size = path.stat().st_size
    if suffix == "3mf":
        try:
            with zipfile.ZipFile(path) as archive:
                size = max(size, sum(entry.file_size for entry in archive.infolist()))
        except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
            raise InputError(f"{path} cannot be read as 3MF: {error}. Export it again.") from error
    if size > LARGEST_FILE:
        raise InputError(
            f"{path} holds {size / 1e6:,.0f} MB, the limit is {LARGEST_FILE / 1e6:,.0f} MB; simplify its meshes."
        )
