"""The notebooks run, and show what they showed when they were committed."""

from pathlib import Path

import pytest

NOTEBOOKS = sorted(Path(__file__).parents[1].glob("examples/notebooks/*.ipynb"))
KINDS = ("image/png", "image/svg+xml", "text/html", "text/plain")


def test_there_are_notebooks():
    assert [path.stem for path in NOTEBOOKS] == ["loop", "recording"]


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
