"""Parts → mesh files: OBJ, STL, PLY, 3MF and GLB."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.errors import InputError, nearest
from mocca_robot.files.meshes import FORMATS, METRES_PER, Z_UP


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

    turned = scaled @ Z_UP[:3, :3] if path.suffix.lower() == ".glb" else scaled
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
        scene.add_geometry(flat, node_name=part.name, geom_name=part.name, transform=Z_UP.T)
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
