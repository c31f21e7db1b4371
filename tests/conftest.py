"""Fixtures of every test module; the table itself is in ``cases.py``."""

import copy
import gc
import os

# Tests run in as many processes as there are cores: threads of BLAS would only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import random
import signal
import sys
from contextlib import contextmanager
from pathlib import Path

import hypothesis
import pytest
from cases import KINDS, MATERIALS, Signals, exciting, tapping
from cyclopts import App, ArgumentCollection
from recordings import recording

import palpate
from palpate import cli
from palpate.spelling import options_in_advice

EXAMPLES = Path(__file__).parents[1] / "examples" / "recordings"
UNDRAWN = "palpate.output.reports.identification.drawing", lambda *_: iter(())

# Tables are as wide as in a pipe, whoever runs the tests: parallel runs say their own width.
os.environ.pop("COLUMNS", None)

# Whoever runs in the background of a shell inherits that Ctrl-C is ignored, and hands it on: tests
# send it to what they start.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Thousands of tests, and what they import, are there to the end: a twentieth of the time went into
# looking through them for garbage again and again.
gc.set_threshold(100_000)

# The same examples in every run, and no clock: a slow machine is not a defect. Another seed and ten
# times as many with --hypothesis-profile=long; the seed is in the header, and on failure again.
hypothesis.settings.register_profile("palpate", deadline=None, derandomize=True)
hypothesis.settings.register_profile("long", deadline=None, max_examples=1000, print_blob=True)
hypothesis.settings.load_profile("palpate")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config):
    if config.option.hypothesis_profile == "long" and config.option.hypothesis_seed is None:
        config.option.hypothesis_seed = random.SystemRandom().randrange(1 << 30)


def pytest_report_header(config):
    return f"seed: {config.option.hypothesis_seed or 'the same in every run'}"


@pytest.fixture(autouse=True, scope="session")
def _options_in_advice():
    """Tests compare sentences as the command line writes them; ``test_spelling`` has the others."""
    with options_in_advice():
        yield


@pytest.fixture(autouse=True, scope="session")
def _options_assembled_once():
    """Tests call commands a thousand times, and cyclopts reads all types of a command for 40 ms."""
    assemble, known = App.assemble_argument_collection, {}

    def assemble_once(app, **options):
        command, inherited = app.default_command, app.app_stack.default_parameter
        if command is None or "<locals>" in command.__qualname__:  # one of a single call
            return assemble(app, **options)
        key = command, repr(inherited), repr(options)
        if key not in known:
            known[key] = assemble(app, **options)
        copies = {id(argument): copy.copy(argument) for argument in known[key]}
        for argument in copies.values():
            argument.tokens = []
            argument.children = ArgumentCollection(copies[id(each)] for each in argument.children)
        return ArgumentCollection(copies.values())

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(App, "assemble_argument_collection", assemble_once)
        yield


@pytest.fixture
def seed(request):
    """Of tests that draw their own examples: 7, or that of --hypothesis-profile=long."""
    return int(request.config.option.hypothesis_seed or 7)


def pytest_addoption(parser):
    parser.addoption(
        "--slow-sample",
        action="store_true",
        help="of each slow test only its first case; with -m slow",
    )


def pytest_collection_modifyitems(config, items):
    if not config.getoption("--slow-sample"):
        return
    seen, left_out = set(), []
    for item in items:
        if item.get_closest_marker("slow"):
            test = item.nodeid.partition("[")[0]
            if test in seen:
                left_out.append(item)
            seen.add(test)
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if item not in set(left_out)]


@pytest.fixture(scope="session", params=KINDS.values(), ids=KINDS)
def kind(request):
    return request.param


@pytest.fixture(scope="session", params=MATERIALS.values(), ids=MATERIALS)
def material(request):
    return request.param


@pytest.fixture(scope="session")
def noisy(material) -> Signals:
    """The three sines on the material, with 0.05 N of noise (the paper's band)."""
    return exciting(material, noise=0.05, seed=1)


@pytest.fixture(scope="session")
def broken(material) -> Signals:
    """The three sines near the surface: contact is lost and made again, with 0.02 N of noise."""
    return tapping(material, noise=0.02, seed=2)


@pytest.fixture(scope="session")
def ball():
    """The identification of the README's recording."""
    return palpate.identify(EXAMPLES / "ball.csv")


@pytest.fixture(scope="session")
def saved(ball, tmp_path_factory):
    """Its folder of results, without drawings, and not to be changed."""
    folder = tmp_path_factory.mktemp("results") / "new" / "ball"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(*UNDRAWN)
        ball.save(folder)
    return folder


@pytest.fixture
def undrawn(monkeypatch):
    """Reports of identifications have no drawings, which take seconds; other tests look at them."""
    monkeypatch.setattr(*UNDRAWN)


@pytest.fixture
def threaded(monkeypatch):
    """Fleets run on a thread of this process: to start a worker process takes seconds."""
    distributed = pytest.importorskip("distributed")

    @contextmanager
    def open_client(**_):
        with (
            distributed.LocalCluster(
                n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
            ) as cluster,
            distributed.Client(cluster, set_as_default=False) as client,
        ):
            yield client

    monkeypatch.setattr("palpate.fleet.running.open_client", open_client)


@pytest.fixture
def run(monkeypatch, capsys):
    """Calls palpate in this process: exit status, standard output, standard error."""

    def call(*arguments) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["palpate", *map(str, arguments)])
        monkeypatch.setenv("NO_COLOR", os.environ.get("NO_COLOR", ""))  # --no-color sets it
        status, handler = 0, signal.getsignal(signal.SIGINT)
        try:
            cli.main()
        except SystemExit as end:
            status = end.code
        finally:
            signal.signal(signal.SIGINT, handler)
        out, err = capsys.readouterr()
        return status, out, err

    return call


@pytest.fixture
def printed(run):
    """Runs a command that succeeds and says nothing on standard error; what it prints."""

    def call(*arguments) -> str:
        status, out, err = run(*arguments)
        assert (status, err) == (0, "")
        return out

    return call


@pytest.fixture
def refused(run):
    """Runs a command that is refused in one line, which is returned."""

    def call(*arguments) -> str:
        status, out, err = run(*arguments)
        assert (status, out, err.count("\n"), err[-1:]) == (2, "", 1, "\n")
        assert err.startswith("palpate: ")
        assert err[:-1].isprintable()
        return err

    return call


@pytest.fixture
def good(tmp_path, monkeypatch):
    """A recording of 600 samples, ``probe.csv`` in an empty folder, which is where palpate runs."""
    monkeypatch.chdir(tmp_path)
    return recording(tmp_path)


@pytest.fixture
def without(monkeypatch):
    """As where a module is not installed: what draws is not imported yet either."""

    def hide(module: str) -> None:
        monkeypatch.setitem(sys.modules, module, None)
        for name in [each for each in sys.modules if each.startswith("palpate.output.figures")]:
            monkeypatch.delitem(sys.modules, name)

    return hide
