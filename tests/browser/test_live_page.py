"""The page of a live run, in a browser: its curves move, its controls act, and it comes back."""

import re
import socket
import socketserver
import threading
import time
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

import numpy as np
import pytest

import palpate
from palpate.live import run
from palpate.live.diagnosing import Diagnosing
from palpate.live.page import Page
from palpate.live.recorder import Recorder
from palpate.live.running import default_estimator
from palpate.live.sources import EndOfSourceError, Replay


class Endless(Replay):
    """A recording again and again at its own pace; every second time 1.6 times as firm."""

    offers = {"material": ["as it is", "firmer"], "change": ["firmer", "softer"]}  # noqa: RUF012

    def __init__(self, contact):
        super().__init__(contact)
        self.ended = threading.Event()
        self.asked = []
        columns = contact.time, contact.penetration, contact.force
        rows = list(zip(*(column.tolist() for column in columns), strict=True))
        span = rows[-1][0] - rows[0][0] + contact.sample_time
        self._rows = (
            (t + k * span, x, f * (1.6 if k % 2 else 1.0)) for k in count() for t, x, f in rows
        )

    def take(self, timeout):
        if self.ended.is_set():
            raise EndOfSourceError
        return super().take(timeout)

    def ask(self, options):
        self.asked.append(options)
        return f"the source received {options}"


@contextmanager
def running(contact, *sinks, estimator=None):
    source, page = Endless(contact), Page(port=0)
    thread = threading.Thread(target=run, args=(source, estimator, [*sinks, page]))
    thread.start()
    try:
        yield source, page
    finally:
        source.ended.set()
        thread.join(30.0)
        page.close()
        assert not thread.is_alive()


def _passed_on(source, sink):
    with suppress(OSError):
        while piece := source.recv(1 << 16):
            sink.sendall(piece)
    _cut(source, sink)


def _cut(*ends):
    for end in ends:
        with suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)


class Wire(socketserver.ThreadingTCPServer):
    """Passes bytes between a browser and a server, until it is cut."""

    daemon_threads = True

    def __init__(self, port):
        super().__init__(("127.0.0.1", 0), None)
        self.whole, self._port, self._ends = True, port, []
        threading.Thread(target=self.serve_forever, daemon=True).start()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.server_address[1]}/"

    def finish_request(self, near, _):
        if self.whole:
            with socket.create_connection(("127.0.0.1", self._port)) as far:
                self._ends += [near, far]
                threading.Thread(target=_passed_on, args=(far, near), daemon=True).start()
                _passed_on(near, far)

    def cut(self):
        self.whole = False
        _cut(*self._ends)

    def __exit__(self, *_):
        self.cut()
        self.shutdown()
        self.server_close()


pytestmark = pytest.mark.browser

BALL = palpate.prepare(Path(__file__).parents[2] / "examples" / "recordings" / "ball.csv")
PIXELS = """name => { const canvas = document.querySelector(`${name} canvas`);
  return canvas.toDataURL(); }"""
# The stiffness, and what stands below it.
TOP_DOWN = ("#working", "#state", ".controls", "#settings-fold", "#law-fold", "#curves-fold")
UNFOLD = "document.querySelectorAll('details').forEach(fold => fold.open = true)"
# Whether the height has been the same for a moment.
SETTLED = """async () => { const before = document.body.scrollHeight;
  await new Promise(done => setTimeout(done, 400));
  return document.body.scrollHeight === before; }"""
# What the card says at one moment: the verdict changes while it is looked at.
CARD = """() => { const text = name => document.querySelector(name).innerText;
  const all = name => [...document.querySelectorAll(name)].map(each => each.innerText);
  return { law: text("#law-name"),
    lead: text("#law-lead"), felt: text("#law-numbers"), numbers: text("#numbers"),
    panels: all(".panel b") }; }"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where recordings go that are begun in the page."""
    return tmp_path_factory.mktemp("recordings")


@pytest.fixture(scope="module")
def live(folder):
    with running(BALL, Recorder(folder=folder)) as (source, page):
        yield source, page.url


@pytest.fixture(scope="module")
def page(live, opened):
    """Its page on a desk, which each test leaves as it was."""
    with opened(live[1]) as made:
        made.evaluate(UNFOLD)
        yield made


def until_true(condition, seconds=30.0):
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.05)


def unfold(page):
    """Open every fold, and forget the shift of what lies below: it was asked for."""
    page.evaluate(UNFOLD)
    until_true(lambda: page.evaluate(SETTLED))
    page.evaluate("globalThis.shifts = 0")


def wait(page, condition):
    """Wait until it holds; looked at from outside, as the page allows no ``eval``."""
    until_true(lambda: page.evaluate(condition))


def card(page, law, lead=""):
    """What the card says while a law is preferred, before others if ``lead`` names one."""
    seen = {}
    until_true(
        lambda: seen.update(page.evaluate(CARD)) or (law in seen["law"] and lead in seen["lead"])
    )
    return seen


# What is wrong of a width is wrong in either theme, and the other way round.
@pytest.mark.parametrize("width, dark", [(1280, False), (390, True)], ids=["desk", "dark phone"])
def test_the_page_moves_and_is_readable(live, opened, width, dark):
    with opened(live[1], width=width, dark=dark) as page:
        assert page.locator("main > details[open]").count() == 0
        rows = page.evaluate("palpate.store.rows")
        wait(page, "palpate.rate >= 20")  # frames a second: a busy machine is no defect of the page
        assert page.evaluate("globalThis.shifts") < 0.005  # nothing that a person would see
        unfold(page)
        before = {name: page.evaluate(PIXELS, name) for name in (".force", ".plane")}
        wait(page, f"palpate.store.rows > {rows + 900}")
        # The laboratory rests for two seconds first.
        for name, pixels in before.items():
            until_true(lambda name=name, pixels=pixels: page.evaluate(PIXELS, name) != pixels)
        until_true(lambda: " ± " in page.inner_text(".number-tile b"))
        page.assert_readable()
        assert page.evaluate("globalThis.shifts") < 0.005  # as above
        assert page.inner_text("#state-name") in ("Contact", "Free", "Changed")
        for number in ("#working", "#damping"):
            assert page.inner_text(number).count("without --no-diagnosis") == 1
            assert page.inner_text(number).count("±") == 1
        assert page.locator("main > details:not([open])").count() == 0  # after the updates
        head, *below = (page.locator(each).first.bounding_box() for each in TOP_DOWN)
        assert head["y"] + head["height"] <= min(each["y"] for each in below)


def test_the_card_names_the_law_without_moving(opened):
    """Of a material that remembers, and is firmer every second time."""
    moment = np.arange(0.0, 3.0, 1e-3)
    depth = 4e-3 - 6e-3 * np.cos(4.0 * np.pi * moment)
    spectrum = palpate.FlatSpectrum(2e-3, 2.048)
    law = palpate.GeneralisedHuntCrossley(K=2e4, n=1.5, B=4e4, p=1.5, M=2e4, relaxation=spectrum)
    velocity = np.gradient(depth, 1e-3)
    force = law.force_along(depth, velocity, 1e-3)
    force += 0.1 * np.random.default_rng(0).standard_normal(force.size)
    contact = palpate.Contact(moment, penetration=depth, velocity=velocity, force=force)
    estimator = default_estimator(palpate.ViscoelasticContact)
    with (
        running(contact, estimator=estimator) as (_, own),
        opened(own.url) as desk,
        opened(own.url, width=390, dark=True) as phone,
    ):
        pages, laws = (desk, phone), {desk: set(), phone: set()}
        for page in pages:
            wait(page, "palpate.page.loop.verdict?.certainty === 'strong'")
            unfold(page)

        def both_change():
            for page in pages:
                laws[page].add((page.inner_text("#law-name"), page.inner_text("#law-badge")))
            return all(len(seen) > 1 for seen in laws.values())

        until_true(both_change)
        for page in pages:
            assert page.evaluate("palpate.page.view['law-turns'][0]")
            seen = card(page, "relaxation", "without relaxation")
            assert page.evaluate("globalThis.shifts") < 0.005  # as above
            assert "M [N/mⁿ]" in seen["numbers"]
            assert "p" not in seen["panels"]
            assert "K′" in seen["felt"]
            assert "Relaxation time" in seen["felt"]  # one at first, then several
            page.assert_readable()


def test_a_page_without_a_recorder_offers_none(opened):
    with running(BALL) as (source, own), opened(own.url, lossy=True) as page:
        assert page.is_disabled("#record")
        page.evaluate(UNFOLD)
        wait(page, "document.querySelector('.number-tile b').textContent.includes('±')")
        source.ended.set()
        page.wait_for_selector("#state[data-state=ended]")
        page.wait_for_selector("#link:has-text('The run has ended: reconnecting')")
        assert page.evaluate("palpate.store.length") > 500
        assert " ± " in page.inner_text(".number-tile b")


def test_a_dropped_connection_heals(live, opened):
    port = int(live[1].rstrip("/").rpartition(":")[2])
    with Wire(port) as wire, opened(wire.url, lossy=True) as page:
        wait(page, "palpate.store.length > 500")
        wire.cut()
        page.wait_for_selector("#link.broken:has-text('reconnecting')")
        time.sleep(0.5)
        wire.whole = True
        page.wait_for_selector("#link:not(.broken):has-text('frames/s')", timeout=15_000)
        rows = page.evaluate("palpate.store.rows")
        wait(page, f"palpate.store.rows > {rows + 500}")


def test_the_keyboard_reaches_every_control(page):
    reached, focused = set(), "document.activeElement.id || document.activeElement.tagName"
    for _ in range(40):
        page.keyboard.press("Tab")
        reached.add(page.evaluate(focused))
    assert {"hold", "tare", "reset", "pause", "download", "SUMMARY", "SELECT"} <= reached
    page.focus("#hold")
    page.keyboard.press("Enter")
    page.wait_for_selector("#state[data-state=held]")
    assert page.inner_text("#hold") == "Resume"
    page.keyboard.press("Enter")
    page.wait_for_selector("#state:not([data-state=held])")
    names = page.evaluate("""() => [...document.querySelectorAll("button, input, select")]
      .filter(each => !(each.textContent.trim() || each.labels?.length || each.ariaLabel))
      .length""")
    assert names == 0


def test_a_change_is_marked_with_the_laws_before_and_after(page):
    wait(page, "palpate.page.changes.length > 0")
    page.wait_for_selector("#changes td div")
    words = page.inner_text("#changes tbody tr")
    assert words.count("K = ") == 2
    assert "N/mⁿ" in words


def test_a_paused_view_stands_still_and_goes_on_without_a_gap(page):
    page.click("#pause")
    time.sleep(0.3)
    before = page.evaluate(PIXELS, ".force"), page.inner_text("#numbers")
    time.sleep(1.0)
    assert (page.evaluate(PIXELS, ".force"), page.inner_text("#numbers")) == before
    assert "paused" in page.inner_text("#link")
    page.click("#pause")
    kept = "[...palpate.store.times.slice(palpate.store.start, palpate.store.end)]"
    # Long before the ten seconds are over that are shown, what was missed has come.
    until_true(lambda: np.max(np.diff(page.evaluate(kept))) < 0.0015, seconds=5.0)
    assert page.evaluate("palpate.store.length") > 1500


def test_the_shown_samples_can_be_downloaded_and_identified(page, tmp_path):
    wait(page, "palpate.store.length > 3000")
    with page.expect_download() as waiting:
        page.click("#download")
    path = tmp_path / waiting.value.suggested_filename
    waiting.value.save_as(path)
    contact = palpate.prepare(path)
    assert len(contact.time) > 2500
    assert contact.sample_time == pytest.approx(1e-3, rel=1e-6)
    assert palpate.identify(path).law.kind == "hunt-crossley"


def test_the_controls_of_the_page_act(live, page):
    page.click("#hold")
    page.wait_for_selector("#state[data-state=held]")
    page.click("#hold")
    page.wait_for_selector("#state:not([data-state=held])")
    page.fill("#seconds", "1")
    page.click("#tare")
    if page.is_visible("#tare-question"):  # in contact, as the next test shows
        page.click("#tare-now")
    page.wait_for_selector("#state[data-state=taring]", timeout=5000)
    page.wait_for_selector("#state:not([data-state=taring])")
    page.click("#reset")
    page.wait_for_selector("#said li:has-text('reset')")
    page.fill("#depth", "5")
    page.click("text=Set depth")
    page.wait_for_selector(".number-tile:has-text('at 5 mm'):has-text('(chosen)')")
    page.click("#median")
    page.click("text=Change now")
    page.wait_for_selector("#said li:has-text('the source received')")
    assert {"change": "firmer"} in live[0].asked


def swinging(middle):
    """A ball, 2 mm around a depth."""
    moment = np.arange(0.0, 3.0, 1e-3)
    depth = middle - 2e-3 * np.cos(4.0 * np.pi * moment)
    velocity = np.gradient(depth, 1e-3)
    law = palpate.HuntCrossley(K=2000.0, B=2000.0, n=1.0)
    force = np.where(depth > 0.0, law.force(np.maximum(depth, 0.0), velocity), 0.0)
    force += 0.01 * np.random.default_rng(0).standard_normal(force.size)
    return palpate.Contact(moment, penetration=depth, velocity=velocity, force=force)


def test_a_tare_in_contact_asks_first(opened):
    sink = Diagnosing(window=2.0, every=0.5)
    with running(swinging(8e-3), sink) as (_, own), opened(own.url) as page:
        wait(page, "palpate.page.state === 'contact'")
        page.evaluate(UNFOLD)
        page.click("#tare")
        words = page.inner_text("#tare-words")
        said = re.fullmatch(r"The probe is in contact with ([\d.]+) N\. palpate refuses .*", words)
        assert 10.0 < float(said[1]) < 35.0  # K x of 6 to 10 mm, B v x, and 1.6 times that
        page.click("#tare-cancel")
        assert page.is_hidden("#tare-question")
        wait(page, "palpate.page.others.diagnosis.verdict")
        # On a busy machine lost samples look like a change, until the next diagnosis.
        tiles = 'document.querySelectorAll(".working .number-tile")'
        wait(page, f"[...{tiles}].every(each => each.innerText.includes('now '))")
        assert "taring" not in page.inner_text("#said")
        shown, numbers = page.evaluate("""() => [
            [...document.querySelectorAll(".working .number-tile")].map(each => each.innerText),
            palpate.page.others.diagnosis.numbers]""")
        for text, line in zip(shown, numbers, strict=True):
            assert text.startswith(f"{line['name'].capitalize()} {line['at']}")
            assert line["value"] in text
            assert line["mark"].replace("-", " ") + (line["reason"] and ": ") in text
            assert "now " in text
        page.click("#hold")  # a held loop does not judge contact, and the probe is in contact still
        page.wait_for_selector("#state[data-state=held]")
        page.click("#tare")
        page.keyboard.press("Escape")
        assert page.is_hidden("#tare-question")
        page.click("#hold")
        page.click("#tare")
        page.click("#tare-now")
        page.wait_for_selector("#said li:has-text('taring for 1 s')")
        page.wait_for_selector("#said li:has-text('the earlier zero holds')")


def test_tare_out_of_contact_asks_nothing(opened):
    sink = Diagnosing(every=3600.0)
    with running(swinging(-8e-3), sink) as (_, own), opened(own.url) as page:
        page.wait_for_selector("#working:has-text('first diagnosis has not finished')")
        wait(page, "palpate.page.state === 'free'")
        page.evaluate(UNFOLD)
        page.click("#tare")
        assert page.is_hidden("#tare-question")
        page.wait_for_selector("#said li:has-text('taring for 1 s')")


def test_a_recording_is_begun_and_ended(page, folder):
    page.wait_for_selector("#record:not([disabled])")
    page.click("#record")
    page.wait_for_selector("#recorded:has-text('MB')")
    time.sleep(1.5)
    page.click("text=Stop recording")
    page.wait_for_selector("#recorded:has-text('recorded')")
    (path,) = folder.iterdir()
    assert len(palpate.open_recording(path).numbers("/input.force")) > 1000


def test_another_estimator_brings_its_own_panels(page):
    assert page.is_visible("#law")
    page.select_option("#method", "single-stage")
    page.fill("#settings input[name=forgetting_factor]", "0.999")
    page.click("text=Start this estimator")
    page.wait_for_selector(".panel.margin")
    assert page.is_hidden("#law")  # the card is of the one that compares laws
    assert page.evaluate("palpate.page.loop.settings")["forgetting_factor"] == 0.999
    page.select_option("#method", "extended-kelvin-voigt")
    page.click("text=Start this estimator")
    page.wait_for_selector("figcaption:has-text('K₂')")
    assert page.query_selector(".panel.margin") is None
    page.fill("#settings input[name=forgetting_factor]", "3")
    page.evaluate("document.querySelector('#estimator').noValidate = true")
    page.click("text=Start this estimator")
    page.wait_for_selector("#answer:has-text('Request refused: factor must be in')")
    page.select_option("#method", "variable-projection")
    page.check("#settings label[title*='misses small changes'] input[name=change_detector]")
    page.check("#settings input[name=outlier_rejection]")
    page.click("text=Start this estimator")
    page.wait_for_selector("figcaption b:text-is('n')")
    wait(page, "palpate.page.loop.settings.change_detector")


def test_thinned_charts_keep_every_peak(page):
    """Of 9000 samples on 300 pixels one is a spike, and 0.2 s are missing."""
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
    known, band, x = (np.array(each, dtype=float) for each in (drawn, band, x))
    assert np.nanmax(known) == 64.0
    assert np.nanmin(known) == pytest.approx(-1.0, abs=1e-5)
    assert np.nanmax(band) == 65.0
    gap = np.isnan(known) & (x > -9.0)
    assert 0.15 < np.ptp(x[gap]) < 0.25  # no line over what is missing
    assert np.all(np.diff(x) > 0.0)
