"""Parts inside parts are found by name, in material and in hollows, and `check` says what to do about them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from solids import box

from mocca_robot.assembly import Assembly, Mesh, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.contacts.find import find_contacts
from mocca_robot.contacts.inside import parts_inside
from mocca_robot.files.assembly_json import write_assembly


def square(low: float, high: float, *holes: tuple[float, float]) -> Polygon:
    def ring(a: float, b: float) -> np.ndarray:
        return np.array([[a, a], [b, a], [b, b], [a, b]])

    return Polygon(ring(low, high), tuple(ring(*h)[::-1] for h in holes), 0.02)


def cube(low: float, high: float, *holes: tuple[float, float]) -> Mesh:
    def filled(a: float, b: float) -> Mesh:
        return box((a, a, a), (b, b, b))

    mesh = filled(low, high)
    for hole in holes:
        hollow = filled(*hole)
        faces = np.concatenate([mesh.faces, hollow.faces[:, ::-1] + len(mesh.vertices)])
        mesh = Mesh(np.concatenate([mesh.vertices, hollow.vertices]), faces)
    return mesh


@pytest.mark.parametrize("shape", [square, cube])
@pytest.mark.parametrize(
    ("inner", "hole", "seen"),
    [((0.4, 0.6), (0.3, 0.7), True), ((0.4, 0.6), None, True), ((0.3, 0.7), (0.3, 0.7), False)],
)
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_part_inside_another_is_found_unless_it_touches_it(shape, inner, hole, seen, scale) -> None:  # type: ignore[no-untyped-def]
    around = shape(0.0, scale, *([tuple(scale * x for x in hole)] if hole else []))
    parts = (Part("shell", around, fixed=True), Part("core", shape(*(scale * x for x in inner))))
    assembly = Assembly("nested", parts)
    found = parts_inside(assembly, find_contacts(assembly).contacts)
    assert found == (((1, 0),) if seen else ())


@pytest.mark.parametrize("shape", [square, cube])
def test_parts_side_by_side_are_not_inside(shape) -> None:  # type: ignore[no-untyped-def]
    assembly = Assembly("row", (Part("a", shape(0.0, 1.0), fixed=True), Part("b", shape(1.5, 2.0))))
    assert parts_inside(assembly, ()) == ()


@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize("fixed", [True, False])
def test_check_warns_with_names_and_a_remedy(
    flat: bool, fixed: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = square if flat else cube
    lid: Polygon | Mesh = box((0, 0, 0.1), (0.1, 0.1, 0.12))
    if flat:
        lid = Polygon(np.array([[0, 0.1], [0.1, 0.1], [0.1, 0.12], [0, 0.12]]), (), 0.02)
    parts = (
        Part("shell", made(0.0, 0.1, (0.03, 0.07)), fixed=True),
        Part("core", made(0.04, 0.06), fixed=fixed),
        Part("lid", lid),
    )
    path = write_assembly(Assembly("nested", parts), tmp_path / "nested.json")
    assert main(["check", str(path)]) == (0 if fixed else 2)
    told = capsys.readouterr()
    said = told.err + told.out
    assert "'core' lies inside 'shell' and touches it nowhere" in said and "in Rhino: BooleanDifference" in said
    assert fixed or "'core' floats free: it shares no face with any other part, and lies inside 'shell'" in told.err
    main(["check", str(path), "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert "inside 'shell'" in (answer["suspicious"][0] if fixed else answer["error"])
