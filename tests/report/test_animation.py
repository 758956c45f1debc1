"""Films of flat assemblies: one sound file, parts end where they belong, what falls falls as recorded."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from mocca_robot.assembly import Assembly, Equilibrium, Part, Polygon
from mocca_robot.report.animation import Shot, film
from mocca_robot.report.figures import stand_alone

SVG = "{http://www.w3.org/2000/svg}"
BOX = np.array([[0.0, 0.0], [0.2, 0.0], [0.2, 0.1], [0.0, 0.1]])


def assembly() -> Assembly:
    parts = [Part("ground", Polygon(BOX - [0, 0.1]), fixed=True)]
    parts += [Part(f"</style><b>{k}", Polygon(BOX + np.array([0, 0.1 * k]))) for k in range(2)]
    return Assembly("a & b", tuple(parts), (Equilibrium(),))


def shots() -> list[Shot]:
    falling = np.zeros((5, 2, 3))
    falling[:, 1] = np.linspace(0, 1, 5)[:, None] * [0.05, -0.02, -0.5]
    stands, falls = assembly(), assembly()
    return [
        Shot(assembly=falls, title="<flat>", ways={}, stands=False, falling=falling, moving=np.array([1, 2])),
        Shot(assembly=stands, title="cone", ways={}),
    ]


def keyframes(text: str, name: str) -> list[tuple[float, str]]:
    inside = re.search(rf"@keyframes {name}\{{(.*?)\}}\}}", text)
    assert inside is not None
    return [(float(at), what) for at, what in re.findall(r"([\d.]+)%\{([^}]*)", inside[1])]


def test_a_film_is_one_sound_file_without_script() -> None:
    text = stand_alone(film(shots(), [-1, 0, 1]))
    root = ET.fromstring(text)
    assert root.tag == f"{SVG}svg" and root.find(f".//{SVG}script") is None
    assert "var(" not in text and "<b>" not in text
    identities = re.findall(r'\bid="([^"]+)"', text)
    assert len(identities) == len(set(identities))
    said = [" ".join(t.itertext()) for t in root.iter(f"{SVG}text")]
    assert "falls" in said[0] and "falls" not in said[1] + text.partition("</style>")[2].partition("<text")[0]
    assert "stands" not in said[1], "nobody asked"


def test_parts_go_in_one_after_the_other_and_end_in_their_places() -> None:
    text = film(shots(), [-1, 0, 1])
    first, second = keyframes(text, "f1p1"), keyframes(text, "f1p2")
    assert "@keyframes f1p0" not in text, "the ground does not move"
    for frames in (first, second):
        times = [t for t, _ in frames]
        assert times == sorted(times) and times[0] == 0.0 and times[-1] == 100.0
        assert "translate(0,0) rotate(0deg)" in frames[-1][1]
    seen = [min(t for t, what in frames if "opacity:1" in what) for frames in (first, second)]
    assert seen[0] < seen[1]


def test_what_falls_ends_where_physics_left_it() -> None:
    text = film(shots(), [-1, 0, 1])
    last = keyframes(text, "f0p2")[-1][1]
    x, y, turn = map(float, re.findall(r"-?[\d.]+", last.partition("transform:")[2]))
    assert turn == pytest.approx(np.rad2deg(0.5), abs=0.01), "clockwise is positive in SVG, where y points down"
    assert x > 0 and y == pytest.approx(0.4 * x, rel=0.02)
    assert re.search(r"translate\(0px,0px\) rotate\(0deg\)", keyframes(text, "f0p1")[-1][1])


def test_readers_who_want_no_motion_see_the_finished_assembly() -> None:
    text = film(shots(), [-1, 0, 1])
    still = text[: text.index("@media (prefers-reduced-motion:no-preference)")] + text[text.index("</style>") :]
    assert "opacity" not in still and "animation" not in still
