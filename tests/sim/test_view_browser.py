"""The viewer in a real browser: it loads, its sliders move parts on the screen, its exported page plays, no errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Watched, chromium
from numpy.typing import NDArray

from benchmarks.random_assemblies import random_assembly, random_solid
from mocca_robot.assembly import Assembly
from mocca_robot.motion.parts_graph import PartsGraph
from sim.show.view import export_page, open_viewer, shown

pytestmark = pytest.mark.browser

CANVAS = {"x": 0, "y": 160, "width": 640, "height": 500}
"""The part of the window that the controls and viser's notices leave free."""


def picture(watched: Watched) -> NDArray[np.uint8]:
    """Return the shown scene (h, w, 3) once it has stopped changing for a while."""
    import io

    from PIL import Image

    last, same = b"", 0
    for _ in range(60):
        watched.page.wait_for_timeout(300)
        now = watched.page.screenshot(clip=CANVAS)
        same = same + 1 if now == last else 0
        if same == 4:
            return np.asarray(Image.open(io.BytesIO(now)).convert("RGB"))
        last = now
    raise AssertionError("the picture never came to rest")


def changed(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    """Return the share of pixels that differ."""
    return float((a != b).any(axis=2).mean())


def press(watched: Watched, label: str, key: str) -> None:
    """Press a key on the slider with this label."""
    watched.page.get_by_text(label, exact=False).first.wait_for()
    row = watched.page.locator("div", has=watched.page.get_by_text(label, exact=False)).filter(
        has=watched.page.get_by_role("slider")
    )
    row.last.get_by_role("slider").first.focus()
    watched.page.keyboard.press(key)


@pytest.mark.parametrize("assembly", [random_assembly("stack", 1), random_solid("blocks", 0)], ids=("flat", "solid"))
def test_every_slider_moves_parts_and_the_console_stays_clean(assembly: Assembly) -> None:
    server: Any = open_viewer(shown(PartsGraph.of(assembly)), 0)
    try:
        with chromium() as watched:
            watched.page.goto(f"http://127.0.0.1:{server.get_port()}")
            watched.page.get_by_text("sequence", exact=True).wait_for()
            whole = picture(watched)
            assert changed(whole, np.full_like(whole, 255)) > 0.03, "the scene is empty"
            press(watched, "sequence", "Home")
            empty = picture(watched)
            assert changed(empty, whole) > 0.02
            press(watched, "sequence", "End")
            assert changed(picture(watched), whole) < 0.005
            press(watched, "exploded view", "End")
            assert changed(picture(watched), whole) > 0.02
            press(watched, "exploded view", "Home")
            press(watched, "time", "End")
            assert changed(picture(watched), whole) > 0.005
            assert not watched.errors
    finally:
        server.stop()


def test_the_exported_page_plays_from_a_file(tmp_path: Path) -> None:
    assembly = random_assembly("stack", 1)
    page = export_page(shown(PartsGraph.of(assembly)), tmp_path / "page.html")
    with chromium() as watched:
        watched.page.goto(page.as_uri())
        watched.page.wait_for_selector("canvas")
        seen = []
        for _ in range(12):
            watched.page.wait_for_timeout(500)
            seen.append(watched.page.screenshot(clip=CANVAS))
        assert len(set(seen)) > 3, "nothing moves"
        assert not watched.errors
