"""A real browser: Debian's chromium, or the one that CHROMIUM names."""

import os
import shutil
from contextlib import contextmanager

import pytest


@pytest.fixture(scope="session")
def chromium():
    """Chromium itself; skips where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="no playwright")
    found = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    if not found:
        pytest.skip("no chromium: apt install chromium, or set CHROMIUM")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def opened(chromium):
    """Opens a file in a window of a width, light or dark; says what it fetched and complained."""

    @contextmanager
    def open_(path, *, width: int, dark: bool):
        context = chromium.new_context(
            viewport={"width": width, "height": 900},
            color_scheme="dark" if dark else "light",
            device_scale_factor=1,
        )
        page = context.new_page()
        page.fetched, page.complaints = [], []
        page.on("request", lambda request: page.fetched.append(request.url))
        page.on("console", lambda message: page.complaints.append(message.text))
        page.on("pageerror", lambda error: page.complaints.append(str(error)))
        page.goto(path.as_uri())
        yield page
        context.close()

    return open_
