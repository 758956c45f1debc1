"""Closed triangle meshes in OBJ, STL, PLY, 3MF and GLB: one part each, read with care and written exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mocca_robot.arrays import Array, IntArray
from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.errors import InputError, nearest
from mocca_robot.geometry.facets import distinct_rows

METRES_PER = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
FORMATS = ("obj", "stl", "ply", "3mf", "glb")
SMALLEST_PART_M, LARGEST_M = 5e-4, 500.0
"""Sizes outside are more often a wrong unit than a real structure."""
FLAT = 1.0 - 1e-9
"""Cosine between two triangles from which they count as one plane."""
LARGEST_FILE = 256 * 1024 * 1024
"""Bytes of one file; ten million triangles are far more than a part needs."""

_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""glTF has y up; here z is."""

_DECLARED = {"meters": "m", "millimeter": "mm", "millimeters": "mm", "centimeter": "cm", "meter": "m", "micron": "um"}
_DECLARED |= {"inch": "in", "inches": "in", "foot": "ft", "feet": "ft", "centimeters": "cm"}


@dataclass(frozen=True, eq=False)
class NamedMesh:
    """A part as it came from a file, in metres, and what had to be repaired."""

    name: str
    mesh: Mesh
    notes: tuple[str, ...] = ()


def read_parts(path: Path, units: str | None = None, *, any_size: bool = False) -> list[NamedMesh]:
    """Return one closed, outward mesh per part, from a file with one object per part or a folder of files.

    In a folder the file stems are the names, in natural order (2 before 10). `units` is a key of `METRES_PER`;
    GLB and 3MF files declare their own, for all others it has to be given. Raises InputError for open meshes,
    unknown units and sizes that look like a wrong unit (unless `any_size`).
    """
    path = Path(path)
    if path.is_dir():
        files = [f for f in path.iterdir() if f.suffix.lower()[1:] in FORMATS]
        if not files:
            raise InputError(f"Folder '{path}' holds no mesh; expected files ending in {', '.join(FORMATS)}.")
        parts = [read_mesh(f, units, any_size=True) for f in sorted(files, key=lambda f: _natural(f.stem))]
    else:
        parts = [_checked(name, v, f, path) for name, v, f in _objects(path, units)]
    if not any_size:
        _check_scale(parts, path)
    return parts


def read_mesh(path: Path, units: str | None = None, *, any_size: bool = False) -> NamedMesh:
    """Return the one part of a mesh file, named after the file; all objects in it belong to the part."""
    path = Path(path)
    vertices, faces, count = [], [], 0
    for _, v, f in _objects(path, units):
        vertices.append(v)
        faces.append(f + count)
        count += len(v)
    part = _checked(path.stem, np.concatenate(vertices), np.concatenate(faces), path)
    if not any_size:
        _check_scale([part], path)
    return part


def repaired(name: str, vertices: Array, faces: IntArray) -> tuple[Mesh, tuple[str, ...]]:
    """Return a closed, outward mesh and a note per repair made.

    Repairs are those that leave no choice of shape: equal corners welded, triangles without area removed, holes of
    three corners or four in a plane closed, triangles turned so that neighbours agree, the whole turned right side
    out. Raises InputError with the number of open edges when the surface does not close.
    """
    notes: list[str] = []
    if len(faces) == 0 or not np.isfinite(vertices).all():
        raise InputError(f"Part '{name}' has no faces or has coordinates that are not numbers; export it again.")
    if np.min(faces) < 0 or np.max(faces) >= len(vertices):
        raise InputError(
            f"Part '{name}' has a face with vertex {int(np.max(faces))}, but only {len(vertices)} vertices; "
            "the file is damaged. Export it again."
        )
    vertices, same = distinct_rows(np.asarray(vertices, dtype=np.float64))
    faces = same[np.asarray(faces, dtype=np.int64)]
    repeated = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    if repeated.any():
        faces = faces[~repeated]
        if len(faces) == 0:
            raise InputError(f"Part '{name}' has no triangle with three corners of its own; export it again.")
        notes.append(f"{int(repeated.sum())} triangles with two equal corners removed")
    used, faces = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], faces.reshape(-1, 3)
    open_edges = count_open_edges(faces)
    if open_edges:
        patched = _patched(vertices, faces)
        if patched is None:
            where = ", ".join(f"{x:.4g}" for x in vertices[_open_edge(faces)].mean(axis=0))
            raise InputError(
                f"Part '{name}' is not closed: {open_edges} of its edges do not join exactly two triangles, one "
                f"near ({where}) m. Only holes of three corners, or four in a plane, are closed here without guessing; "
                "close the surface (in Blender: Select Non Manifold, Fill) and export it again."
            )
        added = len(patched) - len(faces)
        notes.append(f"{added} triangle{'s' * (added > 1)} added to close a hole")
        faces = patched
    if not _consistent(faces):
        import trimesh

        loose = trimesh.Trimesh(vertices, faces, process=False)
        trimesh.repair.fix_winding(loose)
        faces = np.asarray(loose.faces, dtype=np.int64)
        notes.append("triangles turned so that neighbours agree")
        if not _consistent(faces):
            raise InputError(f"Part '{name}' is a one-sided surface (like a Möbius strip); it encloses no volume.")
    mesh = Mesh(vertices, faces)
    extent = float(np.prod(np.ptp(mesh.bounds, axis=0)))
    if extent == 0.0:
        raise InputError(f"Part '{name}' encloses no volume; it is flat.")
    if abs(mesh.volume) <= 1e-9 * extent:
        raise InputError(f"Part '{name}' encloses no volume ({mesh.volume:.3g} m³); it is flat or folded onto itself.")
    if mesh.volume < 0:
        mesh = Mesh(vertices, faces[:, ::-1])
        notes.append("turned right side out")
    corners = mesh.vertices[mesh.faces]
    twice = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    slivers = int((twice <= 1e-9 * longest**2).sum())
    if slivers:
        notes.append(f"{slivers} triangles without area kept (removing them would open the surface)")
    return mesh, tuple(notes)


def count_open_edges(faces: IntArray) -> int:
    """Return how many edges do not belong to an even number of triangles, two for a plain surface."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    return int((count % 2 == 1).sum())


def _open_edge(faces: IntArray) -> IntArray:
    """Return the two corners of an edge that does not belong to an even number of triangles."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    single, count = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(single[count % 2 == 1][0], dtype=np.int64)


def _patched(vertices: Array, faces: IntArray) -> IntArray | None:
    """Return faces with the holes closed whose filling is not a guess; None when others are left."""
    import trimesh

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    trimesh.repair.fill_holes(mesh)
    filled = np.asarray(mesh.faces, dtype=np.int64)
    if len(mesh.vertices) != len(vertices) or count_open_edges(filled):
        return None
    added = filled[len(faces) :]
    corners = vertices[added]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    if not (length > 0.0).all():
        return None
    normals /= length[:, None]
    for a in range(len(added)):
        for b in range(a):
            neighbours = len(set(added[a].tolist()) & set(added[b].tolist())) >= 2
            if neighbours and abs(float(normals[a] @ normals[b])) < FLAT:
                return None
    return filled


def _consistent(faces: IntArray) -> bool:
    """Return whether every directed edge occurs as often as its reverse."""
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    forward = edges[np.lexsort(edges.T)]
    backward = edges[:, ::-1]
    return bool((forward == backward[np.lexsort(backward.T)]).all())


def _checked(name: str, vertices: Array, faces: IntArray, path: Path) -> NamedMesh:
    try:
        mesh, notes = repaired(name, vertices, faces)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return NamedMesh(name, mesh, notes)


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


def _factor(path: Path, units: str | None, declared: str | None) -> float:
    found = units or _DECLARED.get(declared or "")
    if found is None:
        raise InputError(
            f"{path}: {path.suffix[1:].upper()} files carry no unit; give 'units' (one of {', '.join(METRES_PER)})."
        )
    if found not in METRES_PER:
        raise InputError(f"Unknown unit '{found}'; {nearest(found, METRES_PER)}")
    return METRES_PER[found]


def _objects(path: Path, units: str | None) -> list[tuple[str, Array, IntArray]]:
    """Return (name, vertices in metres, triangles) per object of a file."""
    suffix = path.suffix.lower()[1:]
    if not path.is_file():
        raise InputError(f"Mesh file '{path}' does not exist.")
    if suffix not in FORMATS:
        raise InputError(f"'{path}' ends in '.{suffix}'; known mesh formats: {', '.join(FORMATS)}.")
    _require_modest(path, suffix)
    if suffix == "obj":
        from mocca_robot.files.obj import read_obj

        factor = _factor(path, units, None)
        return [(o.name or path.stem, o.vertices * factor, o.triangles()) for o in read_obj(path) if o.faces]
    import trimesh

    try:
        scene = trimesh.load_scene(path, process=False)
    except Exception as error:  # every loader of trimesh fails in its own way
        raise InputError(f"{path} cannot be read as {suffix.upper()}: {error}. Export it again.") from error
    declared = scene.units or next((g.units for g in scene.geometry.values() if g.units), None)
    factor = _factor(path, units, declared if suffix in ("glb", "3mf") else None)
    found = []
    rank = {key: k for k, key in enumerate(scene.geometry)}
    nodes = sorted(scene.graph.nodes_geometry, key=lambda n: (rank[scene.graph[n][1]], str(n)))
    z_up = _Z_UP if suffix == "glb" else np.eye(4)
    for node in nodes:
        transform, key = scene.graph[node]
        transform = z_up @ transform
        geometry = scene.geometry[key]
        if not isinstance(geometry, trimesh.Trimesh):
            continue
        v = np.asarray(geometry.vertices, dtype=np.float64) @ transform[:3, :3].T + transform[:3, 3]
        faces = np.asarray(geometry.faces, dtype=np.int64)
        name = path.stem if suffix in ("stl", "ply") else str(node)
        found.append((name, v * factor, faces))
    if not found:
        raise InputError(f"{path} holds no triangles.")
    return found


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


def write_part(mesh: Mesh, path: Path, *, units: str = "m") -> Path:
    """Return `path` after writing one part there; the suffix is the format. OBJ keeps every bit of a double;
    3MF is in millimetres and GLB in metres whatever `units` says, because these files declare it.
    """
    path = Path(path)
    units = {".3mf": "mm", ".glb": "m"}.get(path.suffix.lower(), units)
    if units not in METRES_PER:
        raise InputError(f"Unknown unit '{units}'; {nearest(units, METRES_PER)}")
    scaled = mesh.vertices / METRES_PER[units]
    if path.suffix.lower() == ".obj":
        lines = [f"o {path.stem}"]
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in scaled.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path
    if path.suffix.lower()[1:] not in FORMATS:
        raise InputError(f"Cannot write '{path.name}'; known mesh formats: {', '.join(FORMATS)}.")
    import trimesh

    turned = scaled @ _Z_UP[:3, :3] if path.suffix.lower() == ".glb" else scaled
    out = trimesh.Trimesh(turned, mesh.faces, process=False)
    out.units = {"m": "meters", "mm": "millimeters"}.get(units, units)
    out.export(path)
    return path


def write_parts(
    names: Sequence[str], meshes: Sequence[Mesh], folder: Path, suffix: str, units: str = "m"
) -> list[Path]:
    """Return the files written into `folder`, one per part, named after it."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    return [write_part(m, folder / f"{n}.{suffix}", units=units) for n, m in zip(names, meshes, strict=True)]


def write_glb(assembly: Assembly, path: Path, colours: Sequence[Sequence[int]] | None = None) -> Path:
    """Return `path` after writing the whole assembly as GLB (y up, metres), one named node per part.

    `colours` are RGBA bytes per part; by default fixed parts are grey and the others run through a soft palette.
    """
    import trimesh

    chosen = colours if colours is not None else part_colours(assembly)
    scene = trimesh.Scene()
    for part, colour in zip(assembly.parts, chosen, strict=True):
        assert isinstance(part.shape, Mesh)
        # Every triangle gets its own corners, so that viewers shade the faces flat.
        corners = part.shape.vertices[part.shape.faces].reshape(-1, 3)
        flat = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
        flat.visual = trimesh.visual.TextureVisuals(
            material=trimesh.visual.material.PBRMaterial(
                baseColorFactor=list(colour), metallicFactor=0.0, roughnessFactor=0.8, doubleSided=False
            )
        )
        scene.add_geometry(flat, node_name=part.name, geom_name=part.name, transform=_Z_UP.T)
    path = Path(path)
    path.write_bytes(scene.export(file_type="glb"))
    return path


def part_colours(assembly: Assembly) -> list[list[int]]:
    """Return RGBA bytes per part: grey when fixed, else hues spaced by the golden angle, pale and readable."""
    import colorsys

    colours = []
    for index, part in enumerate(assembly.parts):
        if part.fixed:
            colours.append([150, 150, 150, 255])
            continue
        r, g, b = colorsys.hls_to_rgb((0.08 + 0.381966 * index) % 1.0, 0.68, 0.55)
        colours.append([round(255 * r), round(255 * g), round(255 * b), 255])
    return colours
