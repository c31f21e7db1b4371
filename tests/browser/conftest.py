"""A real browser: Debian's chromium, or the one that CHROMIUM names."""

import os
import shutil
from contextlib import contextmanager
from functools import partial

import pytest

# Layout that moves although nobody touched anything, from the first paint on.
SHIFTS = """globalThis.shifts = 0;
new PerformanceObserver(list => {
  for (const each of list.getEntries()) if (!each.hadRecentInput) globalThis.shifts += each.value;
}).observe({ type: "layout-shift", buffered: true });"""
CONTRAST = """() => {
  const channel = c => c <= 10 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4;
  const luminance = rgb => { const [r, g, b] = rgb.map(channel);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const numbers = text => text.match(/[\\d.]+/g).map(Number);
  const behind = each => { for (; each; each = each.parentElement) {
    const back = numbers(getComputedStyle(each).backgroundColor);
    if (back.length < 4 || back[3] > 0) return luminance(back.slice(0, 3)); } };
  const words = [...document.querySelectorAll("h1, h2, small, b, p, td, th, dt, dd, li, button, " +
    "label, summary, select, figcaption span, .state span, .badge, text")]
    .filter(each => each.getClientRects().length && each.textContent.trim() && !each.disabled);
  return Math.min(...words.map(each => {
    const style = getComputedStyle(each), back = behind(each);
    const ink = luminance(numbers(each.tagName == "text" ? style.fill : style.color).slice(0, 3));
    return (Math.max(ink, back) + 0.05) / (Math.min(ink, back) + 0.05);
  }));
}"""


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


def assert_readable(page, width, dark):
    """The page fits the width, its text has contrast, and its theme is the requested one."""
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate(CONTRAST) >= 4.5  # as WCAG 2 asks of text
    back = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert back == ("rgb(22, 24, 28)" if dark else "rgb(255, 255, 255)")


@pytest.fixture(scope="session")
def opened(chromium):
    """Opens an address in a window of a width, light or dark.

    At the end nothing came from elsewhere, and nothing was complained of.
    """

    @contextmanager
    def open_(url, ready="body.ready", *, width=1280, dark=False, lossy=False):
        context = chromium.new_context(
            viewport={"width": width, "height": 900},
            color_scheme="dark" if dark else "light",
            device_scale_factor=1,
        )
        page = context.new_page()
        fetched, complaints = [], []
        page.on("request", lambda request: fetched.append(request.url))
        page.on("websocket", lambda socket: fetched.append(socket.url))
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.add_init_script(SHIFTS)
        page.goto(url)
        page.wait_for_selector(ready)
        page.assert_readable = partial(assert_readable, page, width, dark)
        yield page
        own = url.split("//")[-1]
        assert [each for each in fetched if not each.split("//")[-1].startswith(own)] == []
        assert lossy or complaints == []
        context.close()

    return open_
