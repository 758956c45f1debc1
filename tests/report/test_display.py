"""What a script holds says what it is in a line, and shows itself in a notebook, a page and a picture."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest
from physics_models import box_mesh

from mocca_robot import InputError, load, load_ipython_extension, plot, show, verify, write_report
from mocca_robot.assembly import Assembly, Part
from mocca_robot.config.examples import examples_folder
from mocca_robot.motion.parts_graph import PartsGraph
from mocca_robot.report.display import NOTEBOOK_TYPES, markup
from mocca_robot.strength.assess import assess
from mocca_robot.strength.options import StrengthOptions
from mocca_robot.verdicts.physics import Simulation, StateVerdict, TiltVerdict, Verdict
from planners import design

HOSTILE = "</script><b>&\"'"


def solids() -> Assembly:
    parts = (
        Part("floor", box_mesh((0, 0, 0), (2, 2, 1)), fixed=True),
        Part(HOSTILE, box_mesh((0, 0, 1), (2, 2, 2)), material="pla"),
    )
    return Assembly(HOSTILE, parts)


def held() -> Iterator[object]:
    flat = load(examples_folder() / "stack.yaml").assembly
    outcome = design(flat)
    falls, solid = verify(flat), solids()
    yield from (flat, solid, outcome, outcome.design, falls, verify(outcome), verify(solid), *falls.cases)
    yield assess(PartsGraph.of(solid), StrengthOptions())
    states = (StateVerdict(placed=HOSTILE, verdict=Verdict.FELL),)
    tilts = (TiltVerdict(azimuth_rad=0.0, critical_rad=0.2, statics_rad=0.2, friction=0.0),)
    yield Simulation(name=HOSTILE, engine="an engine", states=states, tilt=tilts)


def test_everything_held_has_one_line_and_a_sound_fragment() -> None:
    lines = []
    for what in held():
        line, fragment = repr(what), markup(what)
        assert "\n" not in line and len(line) < 200 and line.startswith(f"<{type(what).__name__}")
        lines.append(line)
        root = ET.fromstring(fragment)
        assert (
            root.get("class") == "mocca-robot" and root.find(".//b") is not None and root.find(".//table") is not None
        )
        assert not re.search(r'<script|https?://(?!www\.w3\.org)|src="(?!data:)', fragment)
        assert len(root.findall(".//b")) == 1, "a name has become markup"
    text = "\n".join(lines)
    assert "does not stand (0 of 1 load cases held)" in text and "stands (1 of 1 load cases held)" in text
    assert "10 joints, achieved" in text and "0 of 1 states stand" in text


def test_notebooks_are_told_of_every_type_that_is_shown() -> None:
    told: dict[tuple[str, str], object] = {}
    html = SimpleNamespace(for_type_by_name=lambda module, name, shown: told.update({(module, name): shown}))
    load_ipython_extension(SimpleNamespace(display_formatter=SimpleNamespace(formatters={"text/html": html})))
    assert set(told) == set(NOTEBOOK_TYPES) and set(told.values()) == {markup}
    assert {(type(w).__module__, type(w).__name__) for w in held()} <= set(told)
    assert all(hasattr(import_module(module), name) for module, name in told)


def test_the_style_of_a_fragment_touches_nothing_outside() -> None:
    style = ET.fromstring(markup(solids())).findtext("style") or ""
    rules = re.findall(r"([^{}]+)\{[^{}]*\}", re.sub(r"@media[^{]*\{", "", style).replace("}}", "}"))
    outside = [s for rule in rules for s in re.split(r",(?![^(]*\))", rule) if ".mocca-robot" not in s]
    assert len(rules) > 40 and not outside


def test_pages_and_pictures_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    solid, flat = solids(), load(examples_folder() / "stack.yaml").assembly
    page = show(solid)
    assert page is not None and opened == [page.as_uri()] and "&lt;/script&gt;" in page.read_text(encoding="utf-8")
    outcome = design(flat)
    assert 'id="joints"' in write_report(outcome, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<script" not in write_report(verify(flat), tmp_path / "verdict.html").read_text(encoding="utf-8")
    drawn = ET.fromstring(plot(outcome, tmp_path / "result.svg").read_text(encoding="utf-8"))
    assert len(drawn.findall(".//{*}path[@class]")) >= 10
    assert plot(verify(flat), tmp_path / "fall.svg").read_text(encoding="utf-8").count("ghost") > 1


def test_what_cannot_be_shown_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="type int cannot be shown"):
        show(3)
    with pytest.raises(InputError, match="type Simulation has no picture"):
        plot(Simulation(name="x", engine="y"), tmp_path / "x.svg")
    with pytest.raises(InputError, match=r"ends in '\.gif'; a picture is an \.svg or a \.png"):
        plot(solids(), tmp_path / "x.gif")
    with pytest.raises(InputError, match=r"ends in '\.pdf'; a report is an \.html"):
        write_report(solids(), tmp_path / "x.pdf")
