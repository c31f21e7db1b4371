"""What README, docs and notebooks show runs, and prints what they say that it prints.

The snippets of a page run in their order, in one folder, as a reader would run them. Directly below
``<!-- not run: REASON -->`` one is only compiled.
"""

import ast
import json
import re
import runpy
import shlex
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest
from ruamel.yaml import YAML

import palpate
from palpate import lab
from palpate.findings import Check

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
EXAMPLES = sorted(ROOT.glob("examples/*.py"))
FENCED = re.compile(r"^(?P<above>[^\n]*)\n```(?P<language>\w+)\n(?P<text>.*?)^```$", re.M | re.S)
NOT_RUN = re.compile(r"<!-- not run: .+ -->")
COMMAND = re.compile(
    r"(?:^|/)palpate "
    r"((?:identify|diagnose|compare|explain|info|payload|skew|fleet|map|design|lab|export) "
    r"[^#&\n]+)",
    re.M,
)


@dataclass(frozen=True)
class Snippet:
    """A fenced block of a page, and the line that it begins at."""

    page: Path
    line: int
    language: str
    text: str
    runs: bool

    def compiled(self):
        """Python whose tracebacks name the page and its lines."""
        return compile("\n" * (self.line - 1) + self.text, self.page.name, "exec")

    @property
    def commands(self) -> list[list[str]]:
        """The complete ``palpate`` commands of a shell block; in a synopsis FILE stands for one."""
        found = map(shlex.split, COMMAND.findall(self.text))
        return [
            words
            for words in found
            if not any("[" in w or (w.isupper() and w[0] != "-") for w in words)
        ]


def snippets_of(page: Path) -> list[Snippet]:
    text = page.read_text(encoding="utf-8")
    return [
        Snippet(
            page,
            text.count("\n", 0, match.start("text")) + 1,
            match["language"],
            match["text"],
            not NOT_RUN.fullmatch(match["above"].strip()),
        )
        for match in FENCED.finditer("\n" + text)
    ]


SNIPPETS = {page: snippets_of(page) for page in PAGES}


@pytest.fixture
def at_home(tmp_path, monkeypatch):
    """An empty folder with the examples, as a checkout's root has them."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def briefly(monkeypatch):
    """The laboratory presses for four seconds at most, which is enough to show that it does."""
    press = lab.Bench.run

    def short(bench, seed=0, *, seconds=10.0, progress=None):
        return press(bench, seed, seconds=min(seconds, 4.0), progress=progress)

    monkeypatch.setattr(lab.Bench, "run", short)


FIRST = ROOT / "README.md", ROOT / "docs" / "start" / "first-answer.md"
# They draw, or call what is not installed everywhere; other tests do the same.
SLOW = {
    "results.md",
    "figures.md",
    "many-contacts.md",
    "map.md",
    "fleet.md",
    "engines.md",
    "simulator.md",
    "contact-force.md",
    "solref.md",
}


def marked(page: Path):
    longer = pytest.mark.slow if page.name in SLOW else pytest.mark.long
    name = str(page.relative_to(ROOT))
    return pytest.param(page, id=name, marks=() if page in FIRST else longer)


# Pages on which a text directly after a command is part of what the command prints.
SHOWN = {
    "first-answer.md", "which.md", "csv.md", "robot-log.md", "testing-machine.md", "afm.md",
    "robot-learning.md", "contact-force.md", "solref.md",
}  # fmt: skip


@pytest.mark.parametrize("page", [marked(page) for page in PAGES if SNIPPETS[page]])
def test_the_snippets_of_a_page_run(page, at_home, briefly, run, capsys, threaded):
    names = {"__name__": "snippet"}
    exact = page.name in SHOWN and page.parent.name in ("start", "how-to")
    for snippet, after in zip(SNIPPETS[page], [*SNIPPETS[page][1:], None], strict=True):
        if snippet.language == "python":
            code = snippet.compiled()
            if snippet.runs:
                exec(code, names)
        elif snippet.language == "sh" and snippet.runs:
            for words in snippet.commands:
                status, out, err = run(*words)
                assert (status, err) == (0, ""), f"{page.name}:{snippet.line}: {words}"
                if exact and after is not None and after.language == "text":
                    assert " ".join(after.text.split()) in " ".join(out.split())
    assert capsys.readouterr().err == ""


#: Libraries without types of their own; everything else in a snippet has them.
UNTYPED = (
    "afmformats", "fsspec", "h5py", "mujoco", "openpyxl", "pandas", "pyarrow", "pyspark", "ray",
    "scipy",
)  # fmt: skip


@pytest.mark.long
def test_the_snippets_of_readme_and_docs_have_types(tmp_path):
    """Those of a page are one script, as they run, whose lines are those of the page."""
    api = pytest.importorskip("mypy.api")
    pages = [ROOT / "README.md", *(page for page in PAGES if page.is_relative_to(ROOT / "docs"))]
    files = []
    for page in pages:
        lines = []
        for snippet in SNIPPETS[page]:
            if snippet.language == "python" and snippet.runs:
                lines += [""] * (snippet.line - 1 - len(lines)) + snippet.text.splitlines()
        if lines:
            name = re.sub(r"\W", "_", str(page.relative_to(ROOT)))
            files.append(tmp_path / f"{name}.py")
            files[-1].write_text("\n".join(lines) + "\n", encoding="utf-8")
    config = tmp_path / "mypy.ini"
    ignored = "".join(f"[mypy-{name}.*]\nignore_missing_imports = true\n" for name in UNTYPED)
    config.write_text(f"[mypy]\nstrict = true\n{ignored}")
    options = ["--config-file", str(config), "--cache-dir", str(tmp_path / "cache")]
    found, complaint, _ = api.run([*options, *map(str, files)])
    assert len(files) > 20
    assert found.startswith("Success"), found + complaint


LINK = re.compile(r"\]\(([^)\s]+)\)|src(?:set)?=\"([^\"]+)\"")


def anchors_of(page: Path) -> set[str]:
    """What a link may name after ``#``: the headings, as GitHub makes anchors of them."""
    text = FENCED.sub("", "\n" + page.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.+)$", text, re.M)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_of_a_page_leads_to_a_file_and_a_heading(page):
    text = FENCED.sub("", "\n" + page.read_text(encoding="utf-8"))
    for link in ("".join(found) for found in LINK.findall(text)):
        name, _, anchor = link.partition("#")
        if ":" not in name:
            file = page.parent / name if name else page
            assert file.exists(), link
            assert not anchor or anchor in anchors_of(file), link


def test_the_readme_and_the_docs_have_snippets_to_run():
    languages = {snippet.language for found in SNIPPETS.values() for snippet in found}
    assert {"python", "sh"} <= languages
    assert ["identify", "examples/recordings/ball.csv", "--figure", "ball.svg"] in [
        words for snippet in SNIPPETS[ROOT / "README.md"] for words in snippet.commands
    ]


def test_the_design_that_is_shown_is_the_design_that_is_printed(run):
    command, shown = SNIPPETS[ROOT / "docs" / "how-to" / "motion.md"][:2]
    [words] = command.commands
    assert run(*words)[1].split() == shown.text.split()


@pytest.mark.long
@pytest.mark.parametrize("page", ["payload.md", "late-force.md"])
def test_what_a_page_shows_of_its_simulation_is_printed(page, run, at_home):
    simulation, command, shown = SNIPPETS[ROOT / "docs" / "how-to" / page][:3]
    exec(simulation.compiled(), {"__name__": "snippet"})
    [words] = command.commands
    printed = run(*words)[1].split()
    assert printed[: len(shown.text.split())] == shown.text.split()


@pytest.mark.parametrize("page", ["README.md", "docs/start/first-answer.md"])
def test_the_result_that_is_shown_is_the_result_that_is_printed(page, run, monkeypatch):
    monkeypatch.chdir(ROOT)
    shown = next(each for each in SNIPPETS[ROOT / page] if each.language == "text")
    assert run("identify", "examples/recordings/ball.csv")[1].split() == shown.text.split()


ANSWERS = {
    "do-not-trust.md": "how-to",
    **dict.fromkeys(("marks.md", "numbers.md", "preparation.md", "relaxation.md"), "explain"),
}


@pytest.mark.long
@pytest.mark.parametrize("name", ANSWERS)
def test_each_line_of_the_first_answer_of_a_page_is_printed(name, run, at_home):
    """An ellipsis stands for lines that the page omits."""
    snippets = iter(SNIPPETS[ROOT / "docs" / ANSWERS[name] / name])
    for snippet in snippets:
        if snippet.language == "text":
            break
        if snippet.language == "python":
            exec(snippet.compiled(), {"__name__": "snippet"})
        else:
            *_, printed = (run(*words)[1] for words in snippet.commands)
    printed_lines = [line.split() for line in printed.splitlines()]
    shown = [line.split() for line in snippet.text.splitlines() if line != "…"]
    assert [line for line in shown if line not in printed_lines] == []


@pytest.mark.long
def test_the_statement_that_is_shown_is_the_statement_that_is_printed(run, at_home, undrawn):
    mujoco = pytest.importorskip("mujoco")
    [shown] = [
        s for s in SNIPPETS[ROOT / "docs" / "reference" / "engines.md"] if s.language == "text"
    ]
    if f"MuJoCo {mujoco.__version__}" not in shown.text:
        pytest.skip("the page shows another version of MuJoCo")
    run("identify", "examples/recordings/ball.csv", "-o", "ball")
    printed = run("export", "ball", "--to", "mujoco", "--mass", "1.0", "-o", "exported")[1]
    assert " ".join(printed.split()).startswith(" ".join(shown.text.split()))


def test_the_json_that_is_shown_has_the_keys_that_are_printed(run):
    page = ROOT / "docs" / "reference" / "results.md"
    [shown, _] = [snippet for snippet in SNIPPETS[page] if snippet.text.startswith("{")]
    recording = ROOT / "examples" / "recordings" / "ball.csv"
    printed = json.loads(run("identify", recording, "--json")[1])
    [result] = printed["results"]
    keys = [*printed, *result, *result["law"], *result["standard_errors"]]
    assert sorted(re.findall(r'"(\w+)":', shown.text)) == sorted(keys)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_an_example_runs(example, briefly, tmp_path, monkeypatch, capsys):
    folder = [str(tmp_path)] if example.name == "make_recordings.py" else []
    monkeypatch.setattr(sys, "argv", [example.name, *folder])
    runpy.run_path(str(example), run_name="__main__")
    out, err = capsys.readouterr()
    assert err == ""
    assert out or sorted(file.name for file in tmp_path.iterdir()) == sorted(
        file.name for file in (ROOT / "examples" / "recordings").iterdir()
    )


def test_every_extra_that_a_message_or_a_page_names_can_be_installed():
    with (ROOT / "pyproject.toml").open("rb") as file:
        known = tomllib.load(file)["project"]["optional-dependencies"].keys()
    for path in [*PAGES, *ROOT.glob("src/**/*.py"), *ROOT.glob(".ci/*")]:
        for names in re.findall(r"(?:palpate|'\.)\[([a-z,]+)\]", path.read_text(encoding="utf-8")):
            assert set(names.split(",")) <= known, f"{path}: {names}"
    named = set()
    for path in ROOT.glob("src/**/*.py"):
        source = path.read_text(encoding="utf-8")
        for call in ast.walk(ast.parse(source)) if "MissingExtra" in source else ():
            if isinstance(call, ast.Call) and ast.unparse(call.func).startswith("MissingExtra"):
                named |= {each.value for each in call.args[-1:] if isinstance(each, ast.Constant)}
    assert {"figures", "report", "live"} <= named <= known


def test_the_workflow_tests_every_supported_python():
    workflow = (ROOT / ".github" / "workflows" / "test.yml").read_text(encoding="utf-8")
    job = YAML(typ="safe").load(workflow)["jobs"]["tests"]
    with (ROOT / "pyproject.toml").open("rb") as file:
        classifiers = tomllib.load(file)["project"]["classifiers"]
    pythons = re.findall(r"Python :: (3\.\d+)", " ".join(classifiers))
    assert job["strategy"]["matrix"]["python"] == pythons
    steps = " && ".join(step["run"] for step in job["steps"] if "run" in step)
    assert steps in [snippet.text.strip() for snippet in SNIPPETS[ROOT / "README.md"]]


FALSE = "verdict on every number", "tens of nanoseconds", "1353", "no law and no error bars"


def test_no_page_claims_what_was_measured_to_be_false():
    for path in [*PAGES, *ROOT.glob("src/**/*.py"), *ROOT.glob("include/**/*.hpp")]:
        text = " ".join(path.read_text(encoding="utf-8").split())
        assert not [words for words in FALSE if words in text], path
        for claim in re.finditer(r"(?:at|attains) the Cramér–Rao bound", text):
            around = text[max(claim.start() - 120, 0) : claim.end() + 120]
            assert all(words in around for words in ("white", "exact", "law")), f"{path}: {around}"


def test_no_page_installs_palpate_from_a_registry():
    """What stands in a message, on a page or in a notebook works in a checkout."""
    texts = [*PAGES, *ROOT.glob("src/**/*.py"), *ROOT.glob("examples/**/*.ipynb")]
    texts += [path for path in ROOT.glob("tests/**/*.py") if path != Path(__file__)]
    assert [path for path in texts if "install 'palpate" in path.read_text(encoding="utf-8")] == []
    words = "x needs y: pip install '.[figures]' in a checkout of palpate"
    assert str(palpate.MissingExtraError.named("x", "y", "figures")) == words


NOTEBOOKS = sorted(Path(__file__).parents[1].glob("examples/notebooks/*.ipynb"))
KINDS = ("image/png", "image/svg+xml", "text/html", "text/plain")


def test_there_are_notebooks():
    assert [path.stem for path in NOTEBOOKS] == ["loop", "paper", "recording"]


# The other takes twice as long, of calls that the snippets of the pages make too.
QUICK = ("loop",)


@pytest.mark.browser
@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=() if path.stem in QUICK else pytest.mark.slow)
        for path in NOTEBOOKS
    ],
)
def test_a_notebook_runs_and_shows_what_it_showed(path):
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    committed = nbformat.read(path, as_version=4)
    again = nbformat.read(path, as_version=4)
    for cell in again.cells:
        cell.pop("outputs", None) if cell.cell_type == "markdown" else cell.update(outputs=[])
    client = nbclient.NotebookClient(
        again, timeout=300, resources={"metadata": {"path": path.parent}}
    )
    client.execute()
    for before, after in zip(committed.cells, again.cells, strict=True):
        if before.cell_type == "code":
            assert _shown(after) == _shown(before), before.source


def _shown(cell) -> list[tuple[str, ...]]:
    """Which kinds of output a cell has; none of them an error, nor words on standard error."""
    kinds = []
    for output in cell.outputs:
        assert output.output_type != "error"
        assert output.get("name") != "stderr", output.text
        kind = tuple(kind for kind in KINDS if kind in output.get("data", {}))
        if kind or kinds[-1:] != [()]:  # printed lines come in as many pieces as they like
            kinds.append(kind)
    return kinds


def test_the_page_of_findings_is_fresh_and_has_one_item_and_one_anchor_for_each_check():
    written = runpy.run_path(str(ROOT / "docs" / "write_findings.py"))
    page = written["PAGE"].read_text("utf-8")
    assert page == written["page"](), "run python docs/write_findings.py"
    headings = re.findall(r"^#+ (.+)$", page, re.M)
    anchors = [heading.lower().replace(" ", "-") for heading in headings]
    assert len(set(anchors)) == len(anchors)
    items = {part.partition("\n")[0]: part for part in page.split("\n### ")[1:]}
    assert list(items) == list(Check)
    assert [title for title, item in items.items() if "*What to do:* " not in item] == []
    assert {check.anchor for check in Check} <= set(anchors)
    pictures = written["PICTURES"]
    drawn = {path.stem for path in (ROOT / "docs" / "images" / "findings").iterdir()}
    assert drawn == {check.anchor + end for check in pictures for end in ("", "-dark")}


def test_the_pages_that_people_read_stay_few_and_short():
    parts = ("start", "how-to", "explain")
    words = {
        page: len(page.read_text(encoding="utf-8").split())
        for part in parts
        for page in (ROOT / "docs" / part).glob("*.md")
    }
    assert len(words) <= 27
    assert sum(words.values()) <= 23_500
    assert max(words.values()) <= 1_500, max(words, key=words.__getitem__)
