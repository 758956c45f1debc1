"""Headless Chromium for tests marked `browser`: a page, what it complains of, and what the machine lacks."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import pytest

FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--use-angle=swiftshader",  # WebGL without a graphics card
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


@dataclass
class Watched:
    """A page and the errors it has shown so far: of its console, of its scripts, and of requests that failed."""

    page: Any
    errors: list[str] = field(default_factory=list)


@contextmanager
def chromium(width: int = 1000, height: int = 700) -> Iterator[Watched]:
    """Yield a watched page; a missing browser fails the test with what to install."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        pytest.fail("Browser tests need playwright: pip install 'mocca-robot[browser]'.", pytrace=False)
    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if path is None:
        pytest.fail("Browser tests need Chromium, on Debian: apt-get install chromium.", pytrace=False)
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=list(FLAGS))
        try:
            watched = Watched(browser.new_page(viewport={"width": width, "height": height}))
            watched.page.on("console", lambda m: watched.errors.append(m.text) if m.type == "error" else None)
            watched.page.on("pageerror", lambda e: watched.errors.append(str(e)))
            watched.page.on("requestfailed", lambda r: watched.errors.append(f"{r.url}: {r.failure}"))
            yield watched
        finally:
            browser.close()
