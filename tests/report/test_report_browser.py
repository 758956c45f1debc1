"""Reports in a real browser: no errors, controls have names, keys step through the sequence, phones can read them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import Watched, chromium

from mocca_robot.cli import main

pytestmark = pytest.mark.browser

ROOT = Path(__file__).parents[2]
UNNAMED = """[...document.querySelectorAll('input, button, select, canvas, svg[role=img]')].filter(e =>
  !(e.getAttribute('aria-label') || e.textContent.trim() || e.closest('label'))).map(e => e.outerHTML.slice(0, 99))"""


@pytest.fixture(scope="module", params=["scarecrow", "sphere"])
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made: Path = tmp_path_factory.mktemp(request.param)
    config = str(ROOT / "configs" / f"{request.param}.yaml")
    assert main(["design", config, "-o", str(made)]) == 0
    assert main(["compare", config, "-o", str(made)]) == 0
    return made


@pytest.fixture
def report(folder: Path) -> Iterator[Watched]:
    with chromium(1200, 900) as watched:
        watched.page.goto((folder / "report.html").as_uri())
        yield watched
        assert not watched.errors


def until_time(watched: Watched, low: float, high: float) -> None:
    """Wait until the sequence is at a time between; the page's policy allows no polling inside it."""
    for _ in range(3000):  # software WebGL on a busy machine draws a frame a second
        if low <= float(watched.page.locator("#time").input_value()) <= high:
            return
        watched.page.wait_for_timeout(50)
    raise AssertionError(f"never between {low} and {high}")


def test_keys_step_through_the_sequence(report: Watched) -> None:
    slider = report.page.locator("#time")
    slider.focus()
    report.page.keyboard.press("Home")
    titles = [slider.get_attribute("aria-valuetext")]
    count = int(slider.get_attribute("max"))
    for step in range(count):
        report.page.keyboard.press("ArrowRight")
        until_time(report, step + 1, step + 1)
        titles.append(slider.get_attribute("aria-valuetext"))
    assert len(set(titles)) == count + 1
    assert [t.split(".")[0] for t in titles[1:]] == [str(k + 1) for k in range(count)]
    report.page.keyboard.press("ArrowLeft")
    assert slider.get_attribute("aria-valuetext") == titles[-2]


def test_it_plays_to_the_end(report: Watched) -> None:
    count = int(report.page.locator("#time").get_attribute("max"))
    report.page.get_by_role("button", name="Play").click()
    until_time(report, 0.0, 0.9)
    until_time(report, count, count)


def test_every_control_and_picture_has_a_name(report: Watched) -> None:
    assert report.page.evaluate(UNNAMED) == []


@pytest.mark.parametrize("name", ["report.html", "comparison.html"])
def test_narrow_screens_scroll_in_one_direction_only(folder: Path, name: str) -> None:
    with chromium(360, 740) as watched:
        watched.page.goto((folder / name).as_uri())
        assert watched.page.evaluate("document.documentElement.scrollWidth") <= 360
        assert not watched.errors
