"""Parts → IFC 4 for building programs, by `ifcopenshell`: one element per part, with its mass."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mocca_robot.assembly import Assembly, Part
from mocca_robot.errors import EnvironmentNeeded
from mocca_robot.geometry.extrusion import surface

PROPERTIES = "MoccaRobot_Part"


def write_ifc(assembly: Assembly, path: Path) -> Path:
    """Return `path` after writing the parts there, in metres, z up; flat parts as plates that stand in the x–z plane.

    Each is an IfcBuildingElementProxy of its name in one storey, in assembly order (`Step`), with density, mass and
    whether it is fixed as properties. Raises EnvironmentNeeded without ifcopenshell.
    """
    try:
        from ifcopenshell.api import aggregate, context, project, pset, root, spatial, unit
    except ImportError:
        raise EnvironmentNeeded(
            "Writing IFC needs the package ifcopenshell: pip install 'mocca-robot[ifc]'. Or export obj, and convert it."
        ) from None
    file = project.create_file(version="IFC4")
    top = root.create_entity(file, ifc_class="IfcProject", name=assembly.name)
    unit.assign_unit(file, length={"is_metric": True, "raw": "METERS"})
    model = context.add_context(file, context_type="Model")
    body = context.add_context(
        file, context_type="Model", context_identifier="Body", target_view="MODEL_VIEW", parent=model
    )
    places = [
        root.create_entity(file, ifc_class=kind, name=name)
        for kind, name in (("IfcSite", "Site"), ("IfcBuilding", assembly.name), ("IfcBuildingStorey", "Ground"))
    ]
    for above, below in zip((top, *places), places):
        aggregate.assign_object(file, products=[below], relating_object=above)
    elements = []
    for step, part in enumerate(assembly.parts):
        element = root.create_entity(file, ifc_class="IfcBuildingElementProxy", name=part.name)
        _shape(file, element, part, body)
        properties = pset.add_pset(file, product=element, name=PROPERTIES)
        values = {"Step": step, "Fixed": bool(part.fixed), "Density": float(part.density), "Mass": float(part.mass)}
        pset.edit_pset(file, pset=properties, properties=values)
        elements.append(element)
    spatial.assign_container(file, products=elements, relating_structure=places[-1])
    path.write_bytes(file.to_string().encode("utf-8"))
    return path


def _shape(file: Any, element: Any, part: Part, context: Any) -> None:
    """Give an element the surface of a part, in double precision."""
    mesh = surface(part)
    points = file.createIfcCartesianPointList3D(mesh.vertices.tolist())
    faces = file.createIfcTriangulatedFaceSet(points, None, True, (np.asarray(mesh.faces) + 1).tolist(), None)
    shown = file.createIfcShapeRepresentation(context, "Body", "Tessellation", [faces])
    element.Representation = file.createIfcProductDefinitionShape(None, None, [shown])
    origin = file.createIfcAxis2Placement3D(file.createIfcCartesianPoint((0.0, 0.0, 0.0)), None, None)
    element.ObjectPlacement = file.createIfcLocalPlacement(None, origin)
