"""SVG drawings: whatever an editor does to a path, the part is the same; shared curves stay shared."""

from pathlib import Path

import numpy as np
import pytest

from mocca_robot.assembly import Polygon
from mocca_robot.errors import InputError
from mocca_robot.files.curves import flattened
from mocca_robot.files.svg import Drawing, read_svg
from mocca_robot.geometry.polygons import to_shapely


def drawing(folder: Path, body: str, root: str = 'width="200mm" height="100mm" viewBox="0 0 200 100"') -> Path:
    path = folder / "drawing.svg"
    names = 'xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
    path.write_text(f"<svg {names} {root}>{body}</svg>", encoding="utf-8")
    return path


def parts(read: Drawing) -> dict[str, Polygon]:
    return dict(read.parts)


SQUARE = [[0.01, -0.02], [0.03, -0.02], [0.03, -0.005], [0.01, -0.005]]


@pytest.mark.parametrize(
    "shape",
    [
        '<rect id="a" x="10" y="5" width="20" height="15"/>',
        '<polygon id="a" points="10,5 30,5 30,20 10,20"/>',
        '<path id="a" d="M10 5h20v15H10z"/>',
        '<path id="a" d="m10,5 l20,0 0,15 -20,0 0,-15"/>',
        '<path inkscape:label="a" d="M10 5 C 15 5 25 5 30 5 L30 20 L10 20 Z"/>',
        '<g transform="translate(10,5)"><rect id="a" width="20" height="15"/></g>',
        '<g transform="translate(4 2)"><g transform="scale(2, 3) translate(3,1)">'
        '<rect id="a" width="10" height="5"/></g></g>',
        '<rect id="a" transform="rotate(90) translate(5, -30)" width="15" height="20"/>',
        '<rect id="a" transform="matrix(0 1 -1 0 30 5)" width="15" height="20"/>',
        '<defs><rect id="r" width="20" height="15"/></defs><use id="a" href="#r" x="10" y="5"/>',
        '<rect id="a" x="10" y="5" width="20" height="15"/><text id="t">hello</text>'
        '<rect id="h" style="display: none" width="3" height="3"/><g display="none"><rect width="4" height="4"/></g>',
        '<style>.off{display:none}</style><rect class="off" width="3" height="3"/>'
        '<rect id="a" x="10" y="5" width="20" height="15"/>',
    ],
)
def test_every_spelling_of_a_rectangle_is_the_same_part(tmp_path: Path, shape: str) -> None:
    found = parts(read_svg(drawing(tmp_path, shape)))
    assert list(found) == ["a"]
    corners = sorted(np.round(found["a"].exterior, 12).tolist())
    assert np.allclose(corners, sorted(SQUARE), atol=1e-12)


@pytest.mark.parametrize(
    ("root", "units", "metres"),
    [
        ('width="200mm" viewBox="0 0 200 100"', None, 1e-3),
        ('width="20cm" viewBox="0 0 200 100"', None, 1e-3),
        ('width="2in" viewBox="0 0 2 1"', None, 0.0254),
        ('width="200px" height="100px"', None, 0.0254 / 96),
        ('width="200" height="100"', "px", 0.0254 / 96),
        ('viewBox="0 0 200 100"', "cm", 1e-2),
        ("", "pt", 0.0254 / 72),
    ],
)
def test_units_come_from_the_drawing_or_from_the_user(
    tmp_path: Path, root: str, units: str | None, metres: float
) -> None:
    path = drawing(tmp_path, '<rect id="a" width="3" height="2"/>', root)
    assert parts(read_svg(path, units))["a"].area_moments[0] == pytest.approx(6 * metres**2, rel=1e-9)
    assert parts(read_svg(path, units, scale=2.0))["a"].area_moments[0] == pytest.approx(24 * metres**2, rel=1e-9)


@pytest.mark.parametrize(
    ("root", "units", "said"),
    [
        ('width="200" height="100"', None, "units: mm"),
        ('width="100%" viewBox="0 0 3 2"', None, "units: mm"),
        ('width="200mm" viewBox="0 0 200 100"', "in", "remove one"),
        ('width="200mm" height="5in" viewBox="0 0 200 100" preserveAspectRatio="none"', None, "mixes units"),
        ('width="200mm" viewBox="0 0 zero 100"', None, "viewBox"),
        ('width="200furlong"', None, "furlong"),
    ],
)
def test_missing_or_contradicting_units_are_refused(tmp_path: Path, root: str, units: str | None, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_svg(drawing(tmp_path, '<rect id="a" width="3" height="2"/>', root), units)


def test_a_curve_stored_twice_in_opposite_directions_gives_the_same_points(tmp_path: Path) -> None:
    body = (
        '<path id="a" d="M 0 40 C 20 50 40 30 60 41 L 60 80 L 0 80 Z"/>'
        '<g transform="translate(30,10) rotate(30)"><path id="b" transform="rotate(-30) translate(-30,-10)" '
        'd="M 60 41 C 40 30 20 50.000001 0 40 L 0 0 L 60 0 Z"/></g>'
    )
    found = parts(read_svg(drawing(tmp_path, body)))
    a, b = (to_shapely(found[n]) for n in "ab")
    assert len(found["a"].exterior) > 10
    assert a.intersection(b).area < 1e-9 * a.area
    assert a.union(b).area == pytest.approx(a.area + b.area, rel=1e-9)
    assert a.union(b).buffer(1e-8).interiors.__len__() == 0
    distance = np.linalg.norm(found["a"].exterior[:, None] - found["b"].exterior[None], axis=2).min(axis=1)
    assert (distance < 1e-8).sum() >= len(found["a"].exterior) - 2


def test_a_disc_fits_its_hole_however_the_two_are_drawn(tmp_path: Path) -> None:
    body = (
        '<circle id="disc" cx="100" cy="50" r="30"/>'
        '<path id="plate" d="M60 10h80v80h-80z M130 50a30 30 0 1 1-60 0a30 30 0 1 1 60 0z"/>'
    )
    found = parts(read_svg(drawing(tmp_path, body)))
    disc, hole = found["disc"].exterior, found["plate"].holes[0]
    assert len(disc) == len(hole)
    assert np.linalg.norm(disc[:, None] - hole[None], axis=2).min(axis=1).max() < 1e-15
    assert found["disc"].area_moments[0] == pytest.approx(np.pi * 0.03**2, rel=2e-3)


def test_a_long_curve_fits_two_neighbours_that_hold_it_in_pieces(tmp_path: Path) -> None:
    p = np.array([[0.0, 40], [40, 80], [60, 10], [100, 45]])
    t = 0.37
    ab, bc, cd = (1 - t) * p[:-1] + t * p[1:]
    abc, bcd = (1 - t) * ab + t * bc, (1 - t) * bc + t * cd
    cut = (1 - t) * abc + t * bcd

    def text(*points: np.ndarray) -> str:
        return " ".join(f"{x:.7f},{y:.7f}" for x, y in points)

    body = (
        f'<path id="long" d="M {text(p[0])} C {text(p[1], p[2], p[3])} L 100,90 0,90 Z"/>'
        f'<path id="left" d="M {text(cut)} C {text(abc, ab, p[0])} L 0,0 {cut[0]:.7f},0 Z"/>'
        f'<path id="right" d="M {text(p[3])} C {text(cd, bcd, cut)} L {cut[0]:.7f},0 100,0 Z"/>'
    )
    found = parts(read_svg(drawing(tmp_path, body)))
    long, left, right = (to_shapely(found[n]) for n in ("long", "left", "right"))
    assert len(found["long"].exterior) > len(found["left"].exterior) > 10
    whole = left.union(right).union(long)
    assert whole.area == pytest.approx(long.area + left.area + right.area, rel=1e-9)
    assert whole.area == pytest.approx(0.1 * 0.09, rel=1e-6)
    assert long.boundary.intersection(left.boundary.union(right.boundary).buffer(1e-8)).length > 0.1


def test_flattening_commutes_with_reversal_and_scale() -> None:
    rng = np.random.default_rng(3)
    curves = rng.normal(size=(40, 4, 2))
    plain = flattened(curves, 3.0)
    turned = flattened(curves[:, ::-1], 3.0)
    large = flattened(curves * 1024.0, 3.0 * 1024.0)
    for a, b, c in zip(plain, turned, large):
        assert np.allclose(a, b[::-1], atol=1e-12)
        assert (c == a * 1024.0).all()
    both = flattened(np.concatenate([curves, curves[:, ::-1]]), 3.0)
    for a, b in zip(both[:40], both[40:]):
        assert (a == b[::-1]).all()


def test_flattened_curves_stay_within_the_chord_tolerance() -> None:
    curve = np.array([[[0.0, 0.0], [0.3, 1.0], [0.7, -1.0], [1.0, 0.2]]])
    line = flattened(curve, 1.0)[0]
    t = np.linspace(0, 1, 4001)[:, None]
    p = curve[0]
    exact = (1 - t) ** 3 * p[0] + 3 * (1 - t) ** 2 * t * p[1] + 3 * (1 - t) * t**2 * p[2] + t**3 * p[3]
    from shapely import LineString, distance, points

    assert distance(points(exact), LineString(line)).max() <= 2e-4


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    body = '<text>x</text><image/><rect id="a" width="3" height="2"/><rect width="1" height="1" visibility="hidden"/>'
    notes = " ".join(read_svg(drawing(tmp_path, body)).notes)
    assert "<text>" in notes and "<image>" in notes and "hidden" in notes


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ('<path id="gate" d="M0 0L10 0L10 10"/>', r"'gate'.*open.*\(0, 0\) mm to \(10, 10\) mm"),
        ('<polyline id="gate" points="0,0 10,0 10,10"/>', "'gate'.*open"),
        ('<line id="gate" x2="10" y2="3"/>', "'gate'.*open"),
        ('<path id="bow" d="M0 0L10 10L10 0L0 10Z"/>', r"'bow'.*itself at \(5, 5\) mm"),
        ('<path id="flat" d="M0 0L10 0L5 0Z"/>', "'flat'.*no area"),
        ('<path id="far" d="M0 0h9v9h-9z M20 0h9v9h-9z"/>', "'far'.*separate pieces"),
        ('<path id="off" d="M0 0h9v9h-9z M8 3h4v2h-4z"/>', "'off'.*hole"),
        ('<path id="cut" d="M0 0L10 0L10"/>', "'cut'"),
        ('<path id="odd" d="drop table"/>', "'odd'.*no SVG path"),
        ('<path id="nan" d="M0 0L nan 3 L 3 3Z"/>', "'nan'"),
        ('<path id="inf" d="M0 0L1e999 3 L 3 3Z"/>', "'inf'.*finite"),
        ('<rect id="w" width="wide" height="3"/>', "'width' of 'w'"),
        ('<rect id="t" width="3" height="3" transform="spin(3)"/>', "transform of 't'"),
        ('<use id="u" href="other.svg#a"/>', "'u'.*other.svg"),
        ('<g id="g"><use id="u" href="#g"/></g>', "nested groups"),
        ("<text>only words</text>", "no visible closed path"),
        ("<g>" * 300 + "</g>" * 300, "nested groups"),
    ],
)
def test_unusable_drawings_are_refused_by_name(tmp_path: Path, body: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_svg(drawing(tmp_path, body))


def test_entities_and_other_documents_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.svg"
    path.write_text('<!DOCTYPE svg [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><svg>&b;</svg>')
    with pytest.raises(InputError, match="entities"):
        read_svg(path, "mm")
    path.write_text("<html/>")
    with pytest.raises(InputError, match="not SVG"):
        read_svg(path, "mm")


def test_clones_of_clones_do_not_explode(tmp_path: Path) -> None:
    layers = '<rect id="l0" width="3" height="2"/>'
    for k in range(1, 40):
        layers += f'<g id="l{k}"><use href="#l{k - 1}"/><use href="#l{k - 1}"/></g>'
    with pytest.raises(InputError, match="simplify"):
        read_svg(drawing(tmp_path, layers))


def test_arcs_are_the_ellipse_they_are_written_as(tmp_path: Path) -> None:
    path = drawing(tmp_path, '<path id="lens" d="M 60 50 A 40 20 30 1 1 140 60 A 40 20 30 1 1 60 50 Z"/>')
    corners = parts(read_svg(path))["lens"].exterior * 1e3 * [1, -1]
    turn = np.deg2rad(30)
    local = (corners - [100, 55]) @ [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]] / [40, 20]
    scale = np.linalg.norm(local, axis=1).max()  # the two ends lie too far apart for these radii: SVG enlarges them
    assert scale > 1 and np.linalg.norm(local, axis=1) / scale == pytest.approx(np.ones(len(local)), abs=1e-5)
    assert len(corners) > 20


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("A 1 1 0 1 1 2 0 A 1 1 0 1 1 0 0 " * 6000, "12,000 arcs; at most 10,000"),
        ("L 9 0 L 0 0 " * 600, "on top of each other, at .*at most 500"),
        ("l 0.001 0.01 l 0.001 -0.01 " * 51_000, "more than 100,000 lines and curves"),
    ],
    ids=["arcs", "copies", "lines"],
)
def test_drawings_that_would_take_minutes_are_refused_with_the_limit(tmp_path: Path, body: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_svg(drawing(tmp_path, f'<path id="p" d="M 0 0 {body} L 100 0 L 100 100 Z"/>'))


def test_corners_drawn_many_times_in_one_place_are_one_corner(tmp_path: Path) -> None:
    path = drawing(tmp_path, f'<path id="a" d="M 10 5 {"L 10 5 " * 5000} h 20 v 15 h -20 z"/>')
    assert len(parts(read_svg(path))["a"].exterior) == 4
