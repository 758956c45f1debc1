"""Parts → mesh files: OBJ, STL, PLY, 3MF, GLB and 3DM."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh
from mocca_robot.errors import InputError, nearest
from mocca_robot.files.meshes import FORMATS, METRES_PER, Z_UP
from mocca_robot.files.ply import ply_bytes
from mocca_robot.files.rhino import write_3dm


def write_part(mesh: Mesh, path: Path, *, units: str = "m") -> Path:
    """Return `path` after writing one part there; the suffix is the format. OBJ, PLY, 3MF and 3DM keep every bit of a
    double; 3MF is in millimetres, GLB and 3DM in metres whatever `units` says, because these files declare it.
    """
    path = Path(path)
    units = {".3mf": "mm", ".glb": "m", ".3dm": "m"}.get(path.suffix.lower(), units)
    if units not in METRES_PER:
        raise InputError(f"Unknown unit '{units}'; {nearest(units, METRES_PER)}")
    scaled = mesh.vertices / METRES_PER[units]
    if path.suffix.lower() == ".obj":
        lines = [f"o {path.stem}"]
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in scaled.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path
    if path.suffix.lower() == ".ply":
        path.write_bytes(ply_bytes(Mesh(scaled, mesh.faces)))
        return path
    if path.suffix.lower() == ".3mf":
        return _write_3mf(scaled, mesh, path)
    if path.suffix.lower() == ".3dm":
        return write_3dm([path.stem], [mesh], path)
    if path.suffix.lower()[1:] not in FORMATS:
        raise InputError(f"Cannot write '{path.name}'; known mesh formats: {', '.join(FORMATS)}.")
    import trimesh

    turned = scaled @ Z_UP[:3, :3] if path.suffix.lower() == ".glb" else scaled
    out = trimesh.Trimesh(turned, mesh.faces, process=False)
    out.units = {"m": "meters", "mm": "millimeters"}.get(units, units)
    out.export(path)
    return path


def _write_3mf(vertices: Array, mesh: Mesh, path: Path) -> Path:
    """Return `path` after writing one part there; `vertices` are in millimetres."""
    from xml.sax.saxutils import quoteattr

    corners = "".join(f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>' for x, y, z in vertices.tolist())
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in mesh.faces.tolist())
    model = (
        '<?xml version="1.0" encoding="UTF-8"?>\n<model unit="millimeter" xml:lang="en-US" '
        f'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources><object id="1" type="model" '
        f"name={quoteattr(path.stem)}><mesh><vertices>{corners}</vertices><triangles>{faces}</triangles></mesh></object>"
        '</resources><build><item objectid="1"/></build></model>'
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (
            ("[Content_Types].xml", _TYPES_3MF),
            ("_rels/.rels", _RELS_3MF),
            ("3D/3dmodel.model", model),
        ):
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), content, zipfile.ZIP_DEFLATED)
    return path


_TYPES_3MF = (
    '<?xml version="1.0" encoding="UTF-8"?>\n<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
)
_RELS_3MF = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="rel0" '
    'Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
)


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
