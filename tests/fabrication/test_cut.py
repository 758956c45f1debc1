"""Cutting drawings: real scale, no overlap, kerf and clearance by the right amount, readable by other programs."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import shapely

from mocca_robot.assembly import Assembly, Mesh, Part, Polygon
from mocca_robot.config.config import CutOptions
from mocca_robot.errors import InputError
from mocca_robot.fabrication.cut import write_cut_dxf, write_cut_svg
from mocca_robot.fabrication.sheet import nested
from mocca_robot.files.svg import read_svg
from mocca_robot.geometry.polygons import to_shapely


@pytest.fixture
def assembly() -> Assembly:
    rng = np.random.default_rng(5)
    parts = []
    for k in range(12):
        n = rng.integers(3, 9)
        angle = np.sort(rng.uniform(0, 2 * np.pi, n) + np.arange(n) * 1e-3)
        angle = np.linspace(0, 2 * np.pi, n, endpoint=False) + 0.3 * rng.uniform(size=n)
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.uniform(0.03, 0.08) + rng.normal(size=2)
        parts.append(Part(f'p{k:02d} <&>" é', Polygon(ring), fixed=k == 0))
    plate = Polygon(
        np.array([[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1]]),
        (np.array([[0.03, 0.03], [0.06, 0.03], [0.06, 0.06], [0.03, 0.06]]),),
    )
    return Assembly("mixed bag", (*parts, Part("plate", plate)))


def test_parts_keep_their_size_and_do_not_overlap_on_the_sheet(assembly: Assembly) -> None:
    options = CutOptions(sheet_width=0.4, spacing=0.004)
    sheet = nested(assembly, options)
    shapes = [shapely.Polygon(p.rings[0], p.rings[1:]) for p in sheet.parts]
    for part, shape in zip(assembly.parts, shapes):
        assert shape.area == pytest.approx(part.shape.area_moments[0] * 1e6, rel=1e-9)
        assert shapely.box(0, 0, 400, sheet.height).contains(shape)
    for a, b in combinations(shapes, 2):
        assert a.distance(b) >= 4.0 - 1e-6
    for part, shape in zip(sheet.parts, shapes):
        assert shape.contains(shapely.Point(part.label_at))


@pytest.mark.parametrize(("kerf", "clearance"), [(2e-4, 0.0), (0.0, 3e-4), (2e-4, 1e-4), (1e-4, 1e-4)])
def test_outlines_move_by_half_of_kerf_minus_clearance(assembly: Assembly, kerf: float, clearance: float) -> None:
    sheet = nested(assembly, CutOptions(kerf=kerf, clearance=clearance))
    half = (kerf - clearance) / 2 * 1e3
    plate = sheet.parts[assembly.index("plate")]
    assert np.ptp(plate.rings[0], axis=0) == pytest.approx([100 + 2 * half] * 2, abs=1e-9)
    assert np.ptp(plate.rings[1], axis=0) == pytest.approx([30 - 2 * half] * 2, abs=1e-9)


def test_the_svg_reads_back_as_the_same_parts(assembly: Assembly, tmp_path: Path) -> None:
    read = read_svg(write_cut_svg(assembly, tmp_path / "cut.svg"))
    assert read.unit == "mm"
    assert [n for n, _ in read.parts] == list(assembly.sequence)
    for (_, polygon), part in zip(read.parts, assembly.parts):
        assert polygon.area_moments[0] == pytest.approx(part.shape.area_moments[0], rel=1e-6)
        assert len(polygon.holes) == len(to_shapely(part.shape).interiors)


def test_the_dxf_is_sound_and_holds_cuts_and_names_on_layers(assembly: Assembly, tmp_path: Path) -> None:
    import ezdxf

    written = write_cut_dxf(assembly, tmp_path / "cut.dxf")
    assert written.read_bytes() == write_cut_dxf(assembly, tmp_path / "again.dxf").read_bytes()
    document = ezdxf.readfile(written)
    assert not document.audit().errors
    assert document.units == ezdxf.units.MM
    cuts = list(document.modelspace().query('LWPOLYLINE[layer=="CUT"]'))
    assert len(cuts) == len(assembly.parts) + 1
    assert all(c.closed for c in cuts)
    area = sum(shapely.Polygon(c.get_points("xy")).area for c in cuts)
    holes = 30.0**2
    assert area - 2 * holes == pytest.approx(sum(p.shape.area_moments[0] for p in assembly.parts) * 1e6, rel=1e-9)
    texts = document.modelspace().query('TEXT[layer=="ENGRAVE"]')
    assert sorted(t.dxf.text for t in texts) == sorted(assembly.sequence)


def test_labels_can_be_left_out(assembly: Assembly, tmp_path: Path) -> None:
    assert "<text" not in write_cut_svg(assembly, tmp_path / "c.svg", CutOptions(labels=False)).read_text("utf-8")


def test_what_cannot_be_cut_is_refused_by_name(assembly: Assembly) -> None:
    with pytest.raises(InputError, match=r"Part 'p\d\d.*sheet_width"):
        nested(assembly, CutOptions(sheet_width=0.03))
    with pytest.raises(InputError, match=r"Part '.*falls apart.*clearance"):
        nested(assembly, CutOptions(clearance=0.09))
    with pytest.raises(InputError, match="'plate' falls apart, or loses a hole"):
        nested(Assembly("a", assembly.parts[-1:]), CutOptions(kerf=0.04))
    tetrahedron = Mesh(np.eye(4, 3), np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]))
    with pytest.raises(InputError, match="'solid' is solid"):
        nested(Assembly("s", (Part("solid", tetrahedron),)), CutOptions())
