"""The gallery: an entry, pictures and a film for each configuration, and figures that a run of today confirms."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

from mocca_robot.cli import main

ROOT = Path(__file__).parents[2]
GALLERY = ROOT / "docs" / "gallery"
CONFIGS = sorted(p.stem for p in (ROOT / "configs").glob("*.yaml"))
FIGURES: dict[str, Any] = json.loads((GALLERY / "figures.json").read_text(encoding="utf-8"))
FLAT = [n for n, f in FIGURES.items() if f["dimension"] == 2]
BUDGET = 6_000_000
"""Bytes that the gallery may weigh in the repository."""


def test_every_configuration_has_its_entry() -> None:
    assert sorted(FIGURES) == CONFIGS
    assert all(f["ok"] and f["stands"] and f["e_after"] < 1e-9 < f["e_before"] for f in FIGURES.values())


@pytest.mark.parametrize("name", CONFIGS)
def test_every_entry_has_a_page_a_picture_and_a_film(name: str) -> None:
    folder, flat = GALLERY / name, FIGURES[name]["dimension"] == 2
    page = (GALLERY / f"{name}.md").read_text(encoding="utf-8")
    film = folder / ("film.svg" if flat else "film.webp")
    for drawing in [folder / "design.svg", *([film] if flat else [])]:
        assert ET.fromstring(drawing.read_text(encoding="utf-8")).tag == "{http://www.w3.org/2000/svg}svg"
        assert f"{name}/{drawing.name}" in page
    if not flat:
        assert film.read_bytes()[8:12] == b"WEBP" and f"{name}/film.webp" in page
    assert (folder / "report.html").is_file() == FIGURES[name]["report"] == (f"{name}/report.html" in page)
    assert ("compared" in FIGURES[name]) == (folder / "comparison.html").is_file()


def test_the_gallery_stays_light() -> None:
    assert sum(p.stat().st_size for p in GALLERY.rglob("*") if p.is_file()) < BUDGET


@pytest.mark.parametrize("name", FLAT)
def test_figures_are_those_of_a_run(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    assert main(["design", f"configs/{name}.yaml", "-o", str(tmp_path), "--json"]) == 0
    said, figures = json.loads(capsys.readouterr().out), FIGURES[name]
    assert {k: said[k] for k in ("parts", "contacts")} == {k: figures[k] for k in ("parts", "contacts")}
    assert said["curved_joints"] == pytest.approx(figures["curved"], abs=2), "solvers may round otherwise elsewhere"
    assert len(said["cases"]) == figures["cases"]
    assert max(c["infeasibility"] for c in said["input_cases"]) == pytest.approx(figures["e_before"], rel=1e-6)
    assert min(i["alpha_deg"] for i in said["insertions"]) == pytest.approx(figures["tightest"]["deg"], abs=1.0)


def test_the_comparisons_say_what_the_article_says() -> None:
    scarecrow = {v["name"]: v for v in FIGURES["scarecrow"]["compared"]}
    assert not scarecrow["planar"]["stands"] and not scarecrow["planar"]["physics_stands"]
    assert scarecrow["single direction"]["stands"] and not scarecrow["single direction"]["as_asked"]
    assert scarecrow["cone joints"]["stands"] and scarecrow["cone joints"]["as_asked"]
    sphere = {v["name"]: v for v in FIGURES["sphere"]["compared"]}
    assert not sphere["planar"]["stands"] and sphere["upright mortise and tenon"]["deadlocked"]
    for name in ("cone joints", "tilted mortise and tenon"):
        assert sphere[name]["stands"] and sphere[name]["physics_stands"] and not sphere[name]["deadlocked"]
