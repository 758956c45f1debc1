"""The studio in headless Chromium: what somebody does in it, step by step, without an error in the console."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

import pytest
from browser import Watched, chromium
from studio_server import Client, studio

from mocca_robot.config.config import load

pytestmark = pytest.mark.browser
CONFIGS = Path(__file__).parents[2] / "configs"
PATIENCE_MS = 30_000


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    folder = tmp_path_factory.mktemp("work")
    (folder / "models").mkdir()
    for name in (
        "leaning_tower_10.yaml",
        "horse.yaml",
        "igloo.yaml",
        "models/leaning_tower_10.svg",
        "models/horse.obj",
    ):
        shutil.copy(CONFIGS / name, folder / name)
    with studio(folder, folder / "leaning_tower_10.yaml") as found:
        yield found


@pytest.fixture
def watched(client: Client) -> Iterator[Watched]:
    with chromium(1300, 860) as found:
        found.page.set_default_timeout(PATIENCE_MS)
        found.page.goto(client.address)
        settled(found.page)
        yield found
        # What a reload or the end of a test cuts off is the stream of events alone.
        assert not [e for e in found.errors if "/events" not in e]


def settled(page: Any) -> None:
    """Wait until everything shown belongs to the present state."""
    page.wait_for_selector(".headline.ok, .headline.bad")
    page.wait_for_selector("#stage:not(.stale)")
    page.wait_for_selector("#progress", state="hidden")


def type_in(page: Any, field: str, value: str) -> None:
    page.fill(field, value)
    page.press(field, "Enter")


def chips(page: Any) -> list[str]:
    return list(page.eval_on_selector_all("#sequence li:not(.fixed)", "all => all.map(c => c.dataset.name)"))


def at(page: Any, selector: str) -> tuple[float, float]:
    box = page.locator(selector).first.bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def drag(page: Any, start: tuple[float, float], end: tuple[float, float]) -> None:
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*[(a + b) / 2 for a, b in zip(start, end)])
    page.mouse.move(*end, steps=4)
    page.mouse.up()


def test_alpha_ten_times_then_undo_all(watched: Watched) -> None:
    page, seconds = watched.page, []
    for value in range(6, 16):
        begun = time.perf_counter()
        type_in(page, "#f-alpha_deg", str(value))
        page.wait_for_selector(f"#undo[title='Undo alpha_deg: {value}']")
        settled(page)
        seconds.append(time.perf_counter() - begun)
    print(f"\nleaning tower, change to picture: median {median(seconds):.2f} s")
    for _ in range(10):
        page.keyboard.press("Escape")
        page.click("#undo")
    page.wait_for_selector("#undo:disabled")
    settled(page)
    assert page.input_value("#f-alpha_deg") == "5"
    page.click("#redo")
    page.wait_for_selector("#undo[title='Undo alpha_deg: 6']")


def test_a_refused_value_stays_and_is_explained(watched: Watched) -> None:
    page = watched.page
    picture = page.inner_html("#flat .picture")
    type_in(page, "#f-alpha_deg", "95")
    error = page.locator(".field[data-key=alpha_deg] .error")
    error.get_by_text("alpha_deg").wait_for()
    assert page.input_value("#f-alpha_deg") == "95"
    assert page.inner_html("#flat .picture") == picture
    watched.errors[:] = [e for e in watched.errors if "422" not in e]  # the browser tells every refusal
    type_in(page, "#f-alpha_deg", "7")
    page.wait_for_selector("#undo[title='Undo alpha_deg: 7']")
    assert error.text_content() == ""


def test_a_corner_is_dragged_and_everything_follows(watched: Watched) -> None:
    page = watched.page
    page.keyboard.press("e")
    page.wait_for_selector("#flat .handle")
    before = page.locator("#flat .handle").count()
    middle = at(page, "#flat")
    handles = [at(page, f"#flat .handle >> nth={k}") for k in range(before)]
    x, y = min(handles, key=lambda p: abs(p[0] - middle[0]) + abs(p[1] - middle[1] + 60))
    drag(page, (x, y), (x + 3, y - 4))
    page.wait_for_selector("#undo[title='Undo corner moved']")
    settled(page)
    assert page.locator("#flat .handle").count() >= before
    page.click("#undo")
    page.wait_for_selector("#undo:disabled")
    settled(page)
    assert page.locator("#flat .handle").count() == before


def test_the_sequence_is_dragged_and_moved_by_keys(watched: Watched) -> None:
    page = watched.page
    before = chips(page)
    drag(
        page,
        at(page, "#sequence li:not(.fixed) >> nth=0"),
        tuple(v + d for v, d in zip(at(page, "#sequence li:not(.fixed) >> nth=2"), (30, 0))),
    )
    page.wait_for_selector("#undo[title^='Undo sequence']")
    page.wait_for_selector(f"#sequence li:not(.fixed) >> nth=2 >> text={before[0]}")
    assert chips(page) == [before[1], before[2], before[0], *before[3:]]
    page.focus(f"#sequence li[data-name={before[0]}]")
    page.keyboard.press("Alt+ArrowLeft")
    page.wait_for_selector(f"#sequence li:not(.fixed) >> nth=1 >> text={before[0]}")
    page.keyboard.press("Escape")
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")
    page.wait_for_selector("#undo:disabled")


def test_parts_and_joints_are_picked_fixed_and_freed(watched: Watched) -> None:
    page = watched.page
    page.click("#flat [data-part='12']")
    name = page.inner_text(".selected h3")
    assert page.locator("#flat .cone").count() == 1
    assert "Goes in" in page.inner_text(".selected")
    page.click("#fixfree")
    page.wait_for_selector(f"#sequence li.fixed[data-name={name}]")
    settled(page)
    page.click("#fixfree")
    page.wait_for_selector(f"#sequence li:not(.fixed)[data-name={name}]")
    page.locator(".selected .actions button", has_text="joint with").first.click()
    page.wait_for_selector("#flat .joint.picked")
    assert "Steepest" in page.inner_text(".selected") or "flat" in page.inner_text(".selected")


def test_tilt_play_let_go_and_views(watched: Watched) -> None:
    page = watched.page
    page.fill("#tilt", "20")
    page.locator("#hint", has_text="tilted by 20°: falls").wait_for()
    assert page.locator("#flat .ghost").count() > 0
    page.fill("#tilt", "0")
    page.click("#play")
    page.wait_for_selector("#sequence li.coming")
    page.wait_for_selector("#sequence li.coming", state="detached")
    page.keyboard.press("1")
    page.locator("h1", has_text="Falls without joints").wait_for()
    page.click("#letgo")
    page.locator("#hint", has_text="MuJoCo: It falls").wait_for()
    page.keyboard.press("2")
    page.fill("#apart", "0.5")
    assert page.locator("#flat .force").count() == 0


def test_a_job_is_cancelled_and_files_are_exported(watched: Watched) -> None:
    page = watched.page
    page.click("#jobs")
    page.get_by_role("button", name="Full simulation").click()
    page.locator(".job >> nth=0").get_by_role("button", name="Cancel").click()
    page.locator(".job >> nth=0").locator("span", has_text="cancelled").wait_for()
    page.get_by_role("button", name="Design files and report").click()
    page.locator(".job >> nth=0").locator("span", has_text="✓ done").wait_for()
    page.get_by_label("Format").select_option("dxf")
    page.get_by_role("button", name="Export").click()
    page.locator(".job >> nth=0 >> text=Export as dxf").wait_for()
    page.locator(".job >> nth=0").locator("span", has_text="✓ done").wait_for()


def test_saved_reloaded_and_two_windows(watched: Watched, client: Client) -> None:
    page = watched.page
    type_in(page, "#f-alpha_deg", "9")
    page.wait_for_selector("#undo[title='Undo alpha_deg: 9']")
    page.keyboard.press("Escape")
    page.reload()
    settled(page)
    assert page.input_value("#f-alpha_deg") == "9"
    other = page.context.browser.new_context().new_page()
    other.set_default_timeout(PATIENCE_MS)
    other.goto(client.address)
    settled(other)
    assert other.input_value("#f-alpha_deg") == "5"
    other.close()
    page.keyboard.press("Control+s")  # the file it was opened from
    page.locator("#toast", has_text="Saved").wait_for()
    saved = page.inner_text("#file")
    config = load(saved)
    assert config.assembly.alpha_rad == pytest.approx(9 * 3.141592653589793 / 180)
    assert Path(saved).read_text(encoding="utf-8").startswith("# A tower of running bond")
    type_in(page, "#f-alpha_deg", "5")
    page.wait_for_selector("#undo[title='Undo alpha_deg: 5']")
    page.click("#save")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_solid_parts_are_shown_turned_and_picked(watched: Watched, scheme: str) -> None:
    page = watched.page
    page.emulate_media(color_scheme=scheme)
    page.keyboard.press("o")
    page.locator("#beside button", has_text="horse.yaml").click()
    page.locator("#name", has_text="horse").wait_for()
    page.wait_for_selector("#solid:not([hidden])")
    settled(page)
    box = page.locator("#solid").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.wait_for_selector(".selected")
    seconds = []
    for value in (6, 7, 8):
        begun = time.perf_counter()
        type_in(page, "#f-alpha_deg", str(value))
        page.wait_for_selector(f"#undo[title='Undo alpha_deg: {value}']")
        settled(page)
        seconds.append(time.perf_counter() - begun)
    print(f"\nhorse, change to picture: median {median(seconds):.2f} s")
    page.fill("#cut", "0.4")
    page.fill("#apart", "0.6")
    page.locator("#azimuth").select_option("90")


def test_a_long_design_shows_progress_at_once(watched: Watched) -> None:
    page = watched.page
    page.keyboard.press("o")
    page.locator("#beside button", has_text="igloo.yaml").click()
    page.wait_for_selector("#progress:not([hidden])")
    page.wait_for_selector("#solid:not([hidden])")
    page.locator("#sequence li", has_text="1 ").first.wait_for()
    begun = time.perf_counter()
    type_in(page, "#f-alpha_deg", "4")
    page.wait_for_selector("#undo[title='Undo alpha_deg: 4']")
    assert page.is_visible("#progress")
    print(f"\nigloo, change to progress: {time.perf_counter() - begun:.2f} s")


def test_on_a_narrow_screen_nothing_sticks_out(watched: Watched) -> None:
    page = watched.page
    page.set_viewport_size({"width": 390, "height": 844})
    page.wait_for_selector(".tabs button[data-tab=settings]:visible")
    wide = page.eval_on_selector("html", "e => e.scrollWidth")
    assert wide <= 390
    page.click(".tabs button[data-tab=settings]")
    assert page.is_visible("#f-alpha_deg")
    assert not page.is_visible("#verdicts")
