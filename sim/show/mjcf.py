"""Models for other programs: a folder with an MJCF file that needs nothing else, and one URDF per part."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from mocca_robot.arrays import Array
from mocca_robot.assembly import Assembly, Mesh, Part
from mocca_robot.files.output import make_folder, safe_file_names, write_atomic
from mocca_robot.geometry.extrusion import surface
from sim.scene import Scene, spec
from sim.shapes.contact_model import embed
from sim.shapes.inertia import inertia

COLOURS = (
    (0.85, 0.55, 0.35),
    (0.45, 0.62, 0.80),
    (0.62, 0.75, 0.45),
    (0.80, 0.70, 0.40),
    (0.65, 0.52, 0.75),
    (0.50, 0.72, 0.70),
)


def export_mjcf(scene: Scene, folder: str | Path) -> Path:
    """Return the path of `scene.xml`, written into `folder` with the parts' surfaces beside it.

    It opens in MuJoCo 3.3 and later and behaves like the scene: full precision, settings included, no outside
    files. Collision shapes are in group 3 (hidden by default), what is seen in group 1.
    """
    target = make_folder(folder)
    names = safe_file_names(p.name for p in scene.assembly.parts)
    for index in np.flatnonzero(scene.present):
        part = scene.assembly.parts[int(index)]
        mesh = surface(part)
        write_atomic(target / "meshes" / f"{names[part.name]}.obj", _obj(mesh.vertices - embed(part.centroid), mesh))
    return write_atomic(target / "scene.xml", mjcf_text(scene, names))


def mjcf_text(scene: Scene, files: dict[str, str]) -> str:
    """Return the MJCF of `scene`; `files` names the mesh file (without .obj) of every part."""
    root = ET.fromstring(spec(scene).to_xml())
    _compatible(root)
    _precise(root, scene)
    _visible(root, scene, files)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def export_urdf(assembly: Assembly, folder: str | Path) -> tuple[Path, ...]:
    """Return the paths of one URDF per part, each with its mesh; the frame is the part's centre of mass."""
    target = make_folder(folder)
    names = safe_file_names(p.name for p in assembly.parts)
    paths = []
    for part in assembly.parts:
        mesh, file = surface(part), names[part.name]
        write_atomic(target / "meshes" / f"{file}.obj", _obj(mesh.vertices - embed(part.centroid), mesh))
        paths.append(write_atomic(target / f"{file}.urdf", urdf_text(part, f"meshes/{file}.obj")))
    return tuple(paths)


def urdf_text(part: Part, mesh_file: str) -> str:
    """Return the URDF of one part: a single link with mass, inertia, visual and collision mesh."""
    solid = Part(part.name, surface(part), part.density, part.fixed)
    tensor = inertia(solid)
    robot = ET.Element("robot", name=part.name)
    link = ET.SubElement(robot, "link", name=part.name)
    body = ET.SubElement(link, "inertial")
    ET.SubElement(body, "origin", xyz="0 0 0", rpy="0 0 0")
    ET.SubElement(body, "mass", value=repr(float(part.mass)))
    entries = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ET.SubElement(body, "inertia", {k: repr(float(tensor[i])) for k, i in entries.items()})
    for kind in ("visual", "collision"):
        shape = ET.SubElement(link, kind)
        ET.SubElement(shape, "origin", xyz="0 0 0", rpy="0 0 0")
        ET.SubElement(ET.SubElement(shape, "geometry"), "mesh", filename=mesh_file)
    ET.indent(robot)
    return ET.tostring(robot, encoding="unicode") + "\n"


def _compatible(root: ET.Element) -> None:
    """Say in words that every 3.x knows what newer ones take for granted, and leave out what older ones refuse."""
    flag = root.find("option/flag")
    if flag is None:
        flag = ET.SubElement(_child(root, "option"), "flag")
    flag.attrib.pop("autoreset", None)
    flag.attrib |= {"multiccd": "enable", "nativeccd": "enable"}
    size = root.find("size")
    if size is not None:
        root.remove(size)
    for mesh in root.iter("mesh"):
        mesh.attrib.pop("inertia", None)


def _precise(root: ET.Element, scene: Scene) -> None:
    """MuJoCo writes six digits; neighbours would overlap by a micrometre. Write all digits."""
    meshes = {m.get("name"): m for m in root.iter("mesh")}
    bodies = {b.get("name"): b for b in root.iter("body")}
    geoms = {g.get("name"): g for g in root.iter("geom")}
    for index in np.flatnonzero(scene.present):
        part = scene.assembly.parts[int(index)]
        bodies[part.name].set("pos", _numbers(embed(part.centroid)))
        if scene.held[index]:
            # A body that never moves needs no mass, but MuJoCo 3.3 asks for one.
            solid = ET.Element("inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
            bodies[part.name].insert(0, solid)
    for number, geom in enumerate(scene.contact_model.only(scene.present).geoms):
        part = scene.assembly.parts[geom.part]
        name, centre = f"{part.name}/{number}", embed(part.centroid)
        geoms[name].set("group", "3")
        if geom.kind == "convex":
            meshes[name].set("vertex", _numbers((geom.points - centre).ravel()))
        else:
            geoms[name].set("pos", _numbers(geom.points[0] - centre))


def _visible(root: ET.Element, scene: Scene, files: dict[str, str]) -> None:
    compiler = _child(root, "compiler")
    compiler.set("meshdir", "meshes")
    assets, bodies = _child(root, "asset"), {b.get("name"): b for b in root.iter("body")}
    for index in np.flatnonzero(scene.present):
        part = scene.assembly.parts[int(index)]
        label = f"{part.name}/surface"
        ET.SubElement(assets, "mesh", name=label, file=f"{files[part.name]}.obj")
        shown = {"type": "mesh", "mesh": label, "contype": "0", "conaffinity": "0", "group": "1", "mass": "0"}
        ET.SubElement(bodies[part.name], "geom", shown, rgba=_numbers((*colour(scene.assembly, int(index)), 1.0)))


def colour(assembly: Assembly, index: int) -> tuple[float, float, float]:
    """Return the colour of a part: grey when fixed, else one of a few that differ between neighbours in sequence."""
    return (0.6, 0.6, 0.6) if assembly.fixed[index] else COLOURS[index % len(COLOURS)]


def _child(root: ET.Element, tag: str) -> ET.Element:
    found = root.find(tag)
    if found is None:
        found = ET.Element(tag)
        root.insert(0, found)
    return found


def _obj(vertices: Array, mesh: Mesh) -> str:
    lines = [f"v {_numbers(v)}" for v in vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    return "\n".join(lines) + "\n"


def _numbers(values: Array | Iterable[float]) -> str:
    return " ".join(repr(float(v)) for v in values)
