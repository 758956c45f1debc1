"""The assembly manual and the look at an input: every part a step in its order, names never markup, pictures whole."""

from __future__ import annotations

import csv
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from solids import box

from mocca_robot.assembly import Assembly, Part, Polygon
from mocca_robot.cli import main
from mocca_robot.files.assembly_json import write_assembly
from mocca_robot.generators import generate
from mocca_robot.report.builder_words import way_words

ROOT = Path(__file__).parents[2]
HOSTILE = '<script>alert("ü")</script> #eval("x") & 石'


def pile() -> Assembly:
    parts = [Part("ground", Polygon(np.array([[0, 0], [0.1, 0], [0.1, 0.02], [0, 0.02]])), fixed=True)]
    for k, name in enumerate(["first", HOSTILE]):
        low = 0.02 + 0.03 * k
        parts.append(Part(name, Polygon(np.array([[0.02, low], [0.08, low], [0.08, low + 0.03], [0.02, low + 0.03]]))))
    return Assembly("pile & more", tuple(parts))


class Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.append(tag)

    def handle_data(self, data: str) -> None:
        self.text += data


def test_every_free_part_is_a_step_in_its_order(tmp_path: Path) -> None:
    source = write_assembly(pile(), tmp_path / "pile.json")
    target = tmp_path / "manual.html"
    assert main(["manual", str(source), "-o", str(target)]) == 0
    page = Reader()
    page.feed(target.read_text(encoding="utf-8"))
    assert page.tags.count("section") == 2 and page.tags.count("svg") == 4 and "script" not in page.tags
    assert page.text.index("first") < page.text.rindex(HOSTILE)
    assert not re.search(r'(?:src|href)="(?!data:)', target.read_text(encoding="utf-8")), "nothing comes from elsewhere"
    rows = list(csv.DictReader((tmp_path / "bill.csv").open(encoding="utf-8", newline="")))
    assert [r["count"] for r in rows] == ["1", "2"] and HOSTILE in rows[1]["parts"]


def test_solids_and_pdf(tmp_path: Path) -> None:
    arch = generate("arch", {"voussoirs": 5, "radius": 0.2, "thickness": 0.05, "width": 0.05})
    source = write_assembly(arch, tmp_path / "arch.json")
    assert main(["manual", str(source), "-o", str(tmp_path / "m.html")]) == 0
    text = (tmp_path / "m.html").read_text(encoding="utf-8")
    assert text.count("<section") == sum(not p.fixed for p in arch.parts)
    assert "Hold " in text, "an arch does not stand before its keystone"
    for assembly, name in ((arch, "arch"), (pile(), "pile")):
        source = write_assembly(assembly, tmp_path / f"{name}.json")
        assert main(["manual", str(source), "-o", str(tmp_path / f"{name}.pdf")]) == 0
        written = (tmp_path / f"{name}.pdf").read_bytes()
        assert written.startswith(b"%PDF-")
        assert main(["manual", str(source), "-o", str(tmp_path / f"{name}.pdf")]) == 0
        assert (tmp_path / f"{name}.pdf").read_bytes() == written, "same input, same output"
    assert main(["manual", str(source), "-o", str(tmp_path / "m.docx")]) == 2


@pytest.mark.parametrize(
    ("direction", "words"),
    [
        ([0, -1], "straight down"),
        ([0.01, 0, -1], "straight down"),
        ([0, 0, 1], "straight up"),
        ([1, 0], "level, to the right"),
        ([-0.5, -0.866], "down, 30° from vertical, to the left"),
        ([0, 0.5, -0.866], "down, 30° from vertical, towards azimuth 90°"),
    ],
)
def test_directions_in_words(direction: list[float], words: str) -> None:
    unit = np.array(direction) / np.linalg.norm(direction)
    assert way_words(unit) == words


@pytest.mark.parametrize("ending", ["svg", "png"])
def test_check_draws_what_it_understood(ending: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_assembly(pile(), tmp_path / "pile.json")
    picture = tmp_path / f"picture.{ending}"
    assert main(["check", str(source), "--picture", str(picture), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["picture"] == str(picture) and found["sizes_m"]["first"] == pytest.approx([0.06, 0.03, 0.02])
    start = picture.read_bytes()[:8]
    assert start.startswith(b"<svg" if ending == "svg" else b"\x89PNG")
    assert main(["check", str(source)]) == 0
    said = capsys.readouterr().out
    assert "60 mm × 30 mm × 20 mm, 43.2 g; touches ground" in said


def test_check_says_what_is_suspicious(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    parts = (
        Part("ground", box((0, 0, 0), (1, 1, 0.1)), fixed=True),
        Part("feather", box((0, 0, 0.1), (1, 1, 0.2)), density=0.6),
        Part("crumb", box((0.5, 0.5, 0.2), (0.505, 0.505, 0.205))),
        Part("shelf", box((0, 0, 3), (1, 1, 3.1)), fixed=True),
        Part("book", box((0, 0, 3.1), (1, 1, 3.2))),
    )
    source = write_assembly(Assembly("odd", parts), tmp_path / "odd.json")
    main(["check", str(source), "--json"])
    said = "\n".join(json.loads(capsys.readouterr().out)["suspicious"])
    for expected in (
        "'feather' has a density of 0.6",
        "'crumb' is tiny",
        "touch over 25 mm² only",
        "'shelf' is fixed, 3 m above",
    ):
        assert expected in said


def test_a_structure_that_falls_says_so_before_the_first_step(tmp_path: Path) -> None:
    def opening(top: float) -> str:
        parts = [Part("ground", Polygon(np.array([[0, 0], [0.1, 0], [0.1, 0.02], [0, 0.02]])), fixed=True)]
        parts.append(Part("first", Polygon(np.array([[0, 0.02], [0.1, 0.02], [0.1, 0.05], [0, 0.05]]))))
        over = np.array([[0.0, 0.05], [0.1, 0.05], [0.1, 0.08], [0.0, 0.08]]) + np.array([top, 0.0])
        parts.append(Part("hat", Polygon(over)))
        source = write_assembly(Assembly("pile", tuple(parts)), tmp_path / "pile.json")
        assert main(["manual", str(source), "-o", str(tmp_path / "manual.html")]) == 0
        page = Reader()
        page.feed((tmp_path / "manual.html").read_text(encoding="utf-8"))
        return page.text[: page.text.index("Parts")]

    assert "Warning" not in opening(0.02)
    assert "does not stand by itself. Without support hat would fall" in opening(0.08)
