"""The page of a live run, in a browser: its curves move, its controls act, and it comes back."""

import json
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import palpate
from palpate.digits import rounded, with_error

pytest.importorskip("uvicorn", reason="the extra live is not installed")
pytest.importorskip("mcap", reason="the extra live is not installed")

from live_runs import Endless, wire_to

from palpate.live import run
from palpate.live.page import Page
from palpate.live.running import default_estimator
from palpate.live.sinks.figures import percent
from palpate.live.sinks.recorder import Recorder

pytestmark = pytest.mark.browser

EXAMPLES = Path(__file__).parents[2] / "examples" / "recordings"
# Layout that moves although nobody touched anything, from the first paint on.
SHIFTS = """globalThis.shifts = 0;
new PerformanceObserver(list => {
  for (const each of list.getEntries()) if (!each.hadRecentInput) globalThis.shifts += each.value;
}).observe({ type: "layout-shift", buffered: true });"""
PIXELS = """name => { const canvas = document.querySelector(`${name} canvas`);
  return canvas.toDataURL(); }"""
# What the card says at one moment: the verdict changes while it is looked at.
CARD = """() => { const text = name => document.querySelector(name).innerText;
  const all = name => [...document.querySelectorAll(name)].map(each => each.innerText);
  return { law: text("#law-name"),
    laws: all("#law-rows th"), scores: all("#law-rows td:last-child"),
    felt: text("#law-numbers"), numbers: text("#numbers"), panels: all(".panel b"),
    offered: palpate.page.loop.verdict.offered }; }"""
CONTRAST = """() => {
  const channel = c => c <= 10 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4;
  const luminance = rgb => { const [r, g, b] = rgb.map(channel);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const numbers = text => text.match(/[\\d.]+/g).map(Number);
  const behind = each => { for (; each; each = each.parentElement) {
    const back = numbers(getComputedStyle(each).backgroundColor);
    if (back.length < 4 || back[3] > 0) return luminance(back.slice(0, 3)); } };
  const words = [...document.querySelectorAll("h1, h2, small, b, p, td, th, dt, dd, li, button, " +
    "label, summary, select, figcaption span, .state span")]
    .filter(each => each.getClientRects().length && each.textContent.trim() && !each.disabled);
  return Math.min(...words.map(each => {
    const ink = luminance(numbers(getComputedStyle(each).color).slice(0, 3)), back = behind(each);
    return (Math.max(ink, back) + 0.05) / (Math.min(ink, back) + 0.05);
  }));
}"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where recordings go that are begun in the page."""
    return tmp_path_factory.mktemp("recordings")


@pytest.fixture(scope="module")
def live(folder):
    """A run with its page."""
    source = Endless(palpate.prepare(EXAMPLES / "ball.csv"))
    page = Page(port=0)
    thread = threading.Thread(target=run, args=(source, None, [Recorder(folder=folder), page]))
    thread.start()
    yield source, page
    source.ended.set()
    thread.join(30.0)
    page.close()
    assert not thread.is_alive()


@contextmanager
def lone_page():
    """A run with nothing but its page, which a test may end."""
    source, own = Endless(palpate.prepare(EXAMPLES / "ball.csv")), Page(port=0)
    thread = threading.Thread(target=run, args=(source, None, [own]))
    thread.start()
    try:
        yield source, own
    finally:
        source.ended.set()
        thread.join(30.0)
        own.close()


@pytest.fixture
def telling():
    """A run that compares laws: a material that remembers, and is firmer every second time."""
    time_ = np.arange(0.0, 3.0, 1e-3)
    depth = 4e-3 - 6e-3 * np.cos(4.0 * np.pi * time_)
    law = palpate.GeneralisedHuntCrossley(
        2e4, 1.5, 4e4, 1.5, 2e4, palpate.FlatSpectrum(2e-3, 2.048)
    )
    velocity = np.gradient(depth, 1e-3)
    force = law.force_along(depth, velocity, 1e-3)
    force += 0.1 * np.random.default_rng(0).standard_normal(force.size)
    contact = palpate.Contact(time_, penetration=depth, velocity=velocity, force=force)
    source, own = Endless(contact), Page(port=0)
    estimator = default_estimator(palpate.ViscoelasticContact)
    thread = threading.Thread(target=run, args=(source, estimator, [own]))
    thread.start()
    yield own
    source.ended.set()
    thread.join(30.0)
    own.close()


@pytest.fixture
def browser(chromium):
    """Opens an address; at the end nothing came from elsewhere, and nothing was complained of."""

    @contextmanager
    def open_(url, *, width=1280, dark=False, lossy=False):
        context = chromium.new_context(
            viewport={"width": width, "height": 900},
            color_scheme="dark" if dark else "light",
            accept_downloads=True,
        )
        page = context.new_page()
        fetched, complaints = [], []
        page.on("request", lambda request: fetched.append(request.url))
        page.on("websocket", lambda socket: fetched.append(socket.url))
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.add_init_script(SHIFTS)
        page.goto(url)
        page.wait_for_selector("body.ready")
        yield page
        own = url.split("//")[1]
        assert {each.split("//")[-1].split("/")[0] + "/" for each in fetched} == {own}
        assert lossy or complaints == []
        context.close()

    return open_


def wait(page, condition, seconds=30.0):
    """Wait until a condition holds; looked at from outside, as the page allows no ``eval``."""
    until = time.monotonic() + seconds
    while not page.evaluate(condition):
        assert time.monotonic() < until, condition
        time.sleep(0.05)


def until_true(condition, seconds=30.0):
    """Wait until it is so."""
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.05)


def frames(page, enough, seconds=30):
    """Frames a second, until they are enough: a busy machine is no defect of the page."""
    for _ in range(2 * seconds):
        time.sleep(0.5)
        if (rate := page.evaluate("palpate.rate")) >= enough:
            break
    return rate


# What is wrong of a width is wrong in either theme, and the other way round.
@pytest.mark.parametrize("width, dark", [(1280, False), (390, True)], ids=["desk", "dark phone"])
def test_the_page_moves_and_is_readable(live, browser, width, dark):
    with browser(live[1].url, width=width, dark=dark) as page:
        before = {name: page.evaluate(PIXELS, name) for name in (".force", ".plane")}
        rows = page.evaluate("palpate.store.rows")
        assert frames(page, 20) >= 20
        assert page.evaluate("palpate.store.rows") - rows > 900
        # The laboratory rests for two seconds first.
        for name, pixels in before.items():
            until_true(lambda name=name, pixels=pixels: page.evaluate(PIXELS, name) != pixels)
        until_true(lambda: " ± " in page.inner_text(".number-tile b"))
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate(CONTRAST) >= 4.5  # as WCAG 2 asks of text
        assert page.evaluate("globalThis.shifts") < 0.005  # nothing that a person would see
        assert page.inner_text("#state-name") in ("Contact", "Free", "Changed")
        back = page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert back == ("rgb(22, 24, 28)" if dark else "rgb(255, 255, 255)")


@pytest.mark.parametrize("width, dark", [(1280, False), (390, True)], ids=["desk", "phone, dark"])
def test_the_card_says_which_law_it_is_and_nothing_moves_when_that_changes(
    telling, browser, width, dark
):
    with browser(telling.url, width=width, dark=dark) as page:
        wait(page, "palpate.page.loop.verdict?.certainty === 'strong'")
        page.evaluate("globalThis.shifts = 0")
        turns = page.evaluate("palpate.page.loop.verdict.turns.length")
        laws = set()
        until = time.monotonic() + 8.0  # in which the material changes twice
        while time.monotonic() < until:
            laws.add((page.inner_text("#law-name"), page.inner_text("#law-badge")))
            time.sleep(0.1)
        assert turns
        assert len(laws) > 1
        assert page.evaluate("globalThis.shifts") < 0.005  # as above
        seen = {}
        until_true(lambda: seen.update(page.evaluate(CARD)) or "flat spectrum" in seen["law"])
        assert seen["laws"] == seen["offered"]
        assert sum(score == "in force" for score in seen["scores"]) == 1
        assert "Relaxing stiffness M" in seen["numbers"]
        assert "τ" not in seen["numbers"]  # no law on offer has one of its own
        assert "p" not in seen["panels"]
        assert "K′" in seen["felt"]
        assert "assumed" in seen["felt"]  # the limits of a spectrum
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate(CONTRAST) >= 4.5


def test_another_estimator_has_no_card(live, browser):
    with browser(live[1].url) as page:
        assert page.is_hidden("#law")


def test_a_change_is_marked_with_the_laws_before_and_after(live, browser):
    with browser(live[1].url) as page:
        wait(page, "palpate.page.changes.length > 0")
        page.wait_for_selector("#changes td div")
        words = page.inner_text("#changes tbody tr")
        assert words.count("K = ") == 2
        assert "N/mⁿ" in words


def test_controls_act(live, browser):
    source, own = live
    with browser(own.url) as page:
        page.click("#hold")
        page.wait_for_selector("#state[data-state=held]")
        assert page.inner_text("#hold") == "Resume"
        page.click("#hold")
        page.wait_for_selector("#state:not([data-state=held])")
        page.click("summary")
        page.fill("#seconds", "2")
        page.click("#tare")
        page.wait_for_selector("#state[data-state=taring]", timeout=5000)
        page.wait_for_selector("#state:not([data-state=taring])")
        page.click("#reset")
        page.wait_for_selector("#said li:has-text('reset')")
        page.fill("#depth", "5")
        page.click("text=Set depth")
        page.wait_for_selector(".number-tile:has-text('5 mm, chosen')")
        page.click("#median")
        page.click("text=Change now")
        page.wait_for_selector("#said li:has-text('the source was asked')")
        assert {"change": "firmer"} in source.asked


def test_a_recording_is_begun_and_ended(live, browser, folder):
    with browser(live[1].url) as page:
        page.wait_for_selector("#record:not([disabled])")
        page.click("#record")
        page.wait_for_selector("#recorded:has-text('MB')")
        time.sleep(1.5)
        page.click("text=Stop recording")
        page.wait_for_selector("#recorded:has-text('recorded')")
    (path,) = folder.iterdir()
    assert len(palpate.open_recording(path).numbers("/input.force")) > 1000


def test_a_page_without_a_recorder_does_not_offer_one(browser):
    with lone_page() as (_, own), browser(own.url, lossy=True) as page:
        assert page.is_disabled("#record")


def test_another_estimator_brings_its_own_panels(live, browser):
    with browser(live[1].url) as page:
        page.click("summary")
        page.select_option("#method", "single-stage")
        page.fill("#settings input[name=forgetting_factor]", "0.999")
        page.click("text=Start this estimator")
        page.wait_for_selector(".panel.margin")
        settings = page.evaluate("palpate.page.loop.settings")
        assert settings["forgetting_factor"] == 0.999
        page.select_option("#method", "extended-kelvin-voigt")
        page.click("text=Start this estimator")
        page.wait_for_selector("figcaption:has-text('K₂')")
        assert page.query_selector(".panel.margin") is None
        page.fill("#settings input[name=forgetting_factor]", "3")
        page.evaluate("document.querySelector('#estimator').noValidate = true")
        page.click("text=Start this estimator")
        page.wait_for_selector("#answer:has-text('Refused: factor must be in')")
        page.select_option("#method", "variable-projection")
        page.check("#settings input[name=change_detector]")
        page.check("#settings input[name=outlier_rejection]")
        page.click("text=Start this estimator")
        page.wait_for_selector("figcaption b:text-is('n')")
        wait(page, "palpate.page.loop.settings.change_detector")


def test_a_paused_view_stands_still_and_goes_on_without_a_gap(live, browser):
    with browser(live[1].url) as page:
        time.sleep(1.0)
        page.click("#pause")
        time.sleep(0.3)
        before = page.evaluate(PIXELS, ".force"), page.inner_text("#numbers")
        time.sleep(1.0)
        assert (page.evaluate(PIXELS, ".force"), page.inner_text("#numbers")) == before
        assert "paused" in page.inner_text("#link")
        page.click("#pause")
        wait(page, "palpate.store.length > 1500")
        steps = page.evaluate(
            "[...palpate.store.times.slice(palpate.store.start, palpate.store.end)]"
        )
        assert np.max(np.diff(steps)) < 0.0015


def test_what_is_shown_can_be_downloaded_and_identified(live, browser, tmp_path):
    with browser(live[1].url) as page:
        wait(page, "palpate.store.length > 3000")
        with page.expect_download() as waiting:
            page.click("#download")
        path = tmp_path / waiting.value.suggested_filename
        waiting.value.save_as(path)
    contact = palpate.prepare(path)
    assert len(contact.time) > 2500
    assert contact.sample_time == pytest.approx(1e-3, rel=1e-6)
    assert palpate.identify(path).law.kind == "hunt-crossley"


def test_the_keyboard_reaches_every_control(live, browser):
    with browser(live[1].url) as page:
        reached = set()
        for _ in range(40):
            page.keyboard.press("Tab")
            reached.add(
                page.evaluate("document.activeElement.id || document.activeElement.tagName")
            )
        assert {"hold", "tare", "reset", "pause", "download", "SUMMARY", "SELECT"} <= reached
        page.focus("#hold")
        page.keyboard.press("Enter")
        page.wait_for_selector("#state[data-state=held]")
        page.keyboard.press("Enter")
        page.wait_for_selector("#state:not([data-state=held])")
        names = page.evaluate("""() => [...document.querySelectorAll("button, input, select")]
          .filter(each => !(each.textContent.trim() || each.labels?.length || each.ariaLabel))
          .length""")
        assert names == 0


def test_a_dropped_connection_heals(live, browser):
    with wire_to(live[1].port) as wire, browser(wire.url, lossy=True) as page:
        wait(page, "palpate.store.length > 500")
        wire.cut()
        page.wait_for_selector("#link.broken:has-text('trying again')")
        time.sleep(0.5)
        wire.join()
        page.wait_for_selector("#link:not(.broken):has-text('frames/s')", timeout=15_000)
        rows = page.evaluate("palpate.store.rows")
        wait(page, f"palpate.store.rows > {rows + 500}")


def test_a_run_that_is_over_stays_on_the_page(browser):
    with lone_page() as (source, own), browser(own.url, lossy=True) as page:
        wait(page, "document.querySelector('.number-tile b').textContent.includes('±')")
        source.ended.set()
        page.wait_for_selector("#state[data-state=ended]")
        page.wait_for_selector("#link:has-text('The run is over: trying again')")
        assert page.evaluate("palpate.store.length") > 500
        assert " ± " in page.inner_text(".number-tile b")


def test_what_is_drawn_has_every_peak_of_what_came(live, browser):
    """Of 9000 samples on 300 pixels one is a spike, and 0.2 s are missing."""
    with browser(live[1].url) as page:
        drawn, band, x = page.evaluate(
            """async () => {
            const { Pieces, Store } = await import("/static/store.js");
            const store = new Store(["force", "error"], 10);
            for (let k = 0; k < 9000; k += 90) { // as frames come
              const rows = Array.from({ length: 90 }, (_, i) => k + i);
              store.append(
                Float64Array.from(rows, row => 50 + (row + (row >= 4500 ? 200 : 0)) * 1e-3),
                [Float32Array.from(rows, row => row === 3333 ? 64 : Math.sin(row / 500)),
                  new Float32Array(90).fill(0.5)]);
            }
            const pieces = new Pieces(store, 300);
            return [pieces.extremes("force"), pieces.edge("force", "error", 2), pieces.x];
            }"""
        )
    known = np.array([np.nan if each is None else each for each in drawn])
    assert np.nanmax(known) == 64.0
    assert np.nanmin(known) == pytest.approx(-1.0, abs=1e-5)
    assert np.nanmax([each for each in band if each is not None]) == 65.0
    gap = np.isnan(known) & (np.array(x) > -9.0)
    assert 0.15 < np.ptp(np.array(x)[gap]) < 0.25  # no line over what is missing
    assert np.all(np.diff(x) > 0.0)


def test_numbers_are_written_as_everywhere_else(live, browser):
    generator = np.random.default_rng(8)
    values = generator.choice([-1.0, 1.0], 3000) * 10.0 ** generator.uniform(-12, 12, 3000)
    errors = np.abs(values) * 10.0 ** generator.uniform(-6, 3, 3000)
    # Those that stand in the middle between two digits, and the edges of the rule.
    edges = [
        (2.5, 10.0),
        (3.5, 10.0),
        (0.5, 1.0),
        (1.25, 0.3),
        (1.35, 0.3),
        (12.0, 340.0),
        (0.0, 1e-6),
    ]
    edges += [
        (25.0, 100.0),
        (35.0, 120.0),
        (1e5, 780.0),
        (99.95, 0.355),
        (1.0, 0.0949),
        (5.0, 0.095),
        (5.0, float("nan")),
        (5.0, float("inf")),
    ]
    fractions = [1.0, 0.999_934, 0.9, 0.999_999_8, 0.5, 0.0]
    pairs = [*edges, *zip(values.tolist(), errors.tolist(), strict=True)]
    with browser(live[1].url) as page:
        found = page.evaluate(
            """async pairs => { const { withError, rounded } = await import("/static/digits.js");
            return pairs.map(([value, error]) =>
              [withError(value, [error], "N"), rounded(value, 4), rounded(error, 2)]); }""",
            json.loads(json.dumps(pairs)),
        )
        parts = page.evaluate(
            """async parts => { const { percent } = await import("/static/digits.js");
            return parts.map(percent); }""",
            fractions,
        )
    expected = [
        [with_error(value, error, unit="N"), rounded(value, 4), rounded(error, 2)]
        for value, error in pairs
    ]
    assert found == expected
    assert parts == [percent(each) for each in fractions]
