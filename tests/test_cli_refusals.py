"""Bad input on the command line: one line that says what and where, exit status 2, no traceback."""

import pytest
from recordings import recording, text_of, written
from test_csv import BAD_FILES, changed


@pytest.fixture
def refused(run):
    """Calls the command, checks that it refuses as it should, and gives its one line."""

    def call(*arguments) -> str:
        status, out, err = run(*arguments)
        assert (status, out, err.count("\n"), err[-1:]) == (2, "", 1, "\n")
        assert err.startswith("palpate: ")
        return err

    return call


@pytest.fixture
def good(tmp_path):
    return recording(tmp_path)


@pytest.mark.parametrize("content, words", BAD_FILES.values(), ids=BAD_FILES)
def test_a_bad_file_is_one_line(refused, tmp_path, content, words):
    path = written(tmp_path / "bad.csv", content)
    line = refused("identify", path, "--strict")
    assert all(word in line for word in (str(path), *words))


@pytest.mark.parametrize("command, extra", [("identify", "--json"), ("compare", "--dark")])
def test_a_bad_file_is_one_line_whatever_was_asked_for(
    refused, tmp_path, monkeypatch, command, extra
):
    monkeypatch.chdir(tmp_path)
    path = written(tmp_path / "bad.csv", changed(3, 0, "0.0015"))
    assert "row 5" in refused(command, path, "--strict", "--figure", "out.svg", extra)
    assert [file.name for file in tmp_path.iterdir()] == ["bad.csv"]


NEVER = {
    "never in contact": [["0", "-0.01", "0.0"], ["0.1", "-0.01", "0.0"], ["0.2", "-0.02", "0.1"]],
    "pulling all along": [["0", "0.01", "-1"], ["0.1", "0.01", "-1"], ["0.2", "0.01", "-1"]],
    "of nothing known": [["0", "nan", "nan"], ["0.1", "nan", "nan"]],
    "of absurd values": [["0", "1e300", "1e300"], ["1", "2e300", "-1e308"], ["2", "3e300", "1e308"],
                         ["3", "1e300", "-1e308"], ["4", "1e300", "1e308"], ["5", "1e300", "1"]],
}  # fmt: skip


@pytest.mark.parametrize("name", NEVER)
def test_a_probe_that_never_touches_is_one_line(refused, tmp_path, name):
    path = written(tmp_path / "never.csv", text_of(NEVER[name]))
    numbers = not name.startswith("of ")
    words = "the probe never touches" if numbers else "column 'penetration_m': no sample holds a"
    assert f"{path}: {words}" in refused("identify", path)


def test_what_is_no_file_is_one_line(refused, tmp_path):
    assert f"{tmp_path}: the folder holds no bag" in refused("identify", tmp_path)
    absent = tmp_path / "absent.csv"
    assert f"{absent}: No such file or directory" in refused("compare", absent)
    refused("identify", tmp_path / "two\nlines.csv")
    refused("identify")
    assert "press" in refused("press")


BAD_ARGUMENTS = {
    "an unknown method": (("--method", "spring"), ["must be one of", "single-stage", "'spring'"]),
    "an unknown option": (("--colour", "red"), ["--colour"]),
    "a misspelt option": (("--surfce", "fit"), ["--surfce", "Did you mean --surface?"]),
    "text for a number": (("--start", "soon"), ["--start", "soon"]),
    "a window without samples": (("--start", "5"), ["no sample between 5 s", "0.599 s"]),
    "a window that ends before it starts": (("--start", "0.3", "--stop", "0.2"), ["no sample"]),
    "a negative force": (("--min-force", "-1"), ["minimum_force", "-1"]),
    "a force that is not a number": (("--min-force", "nan"), ["nan"]),
    "a depth that nothing reaches": (("--min-penetration", "1"), ["never touches", "above 1 m"]),
    "a velocity window that is not a number": (("--velocity-window", "nan"), ["nan"]),
    "a negative velocity window": (("--velocity-window", "-1"), ["-1"]),
    "a column that is not there": (("--force", "Fz"), ["no column 'Fz'", "force_N", "name others"]),
    "a velocity column that is not there": (("--velocity", "v"), ["no column 'v'"]),
    "a figure of no format": (("--figure", "out.eps"), ["out.eps", "end in .svg, .pdf or .png"]),
    "a figure without an ending": (("--figure", "out"), ["out", "end in .svg, .pdf or .png"]),
    "a figure of an ending only": (("--figure", ".svg"), [".svg", ".png"]),
    "a figure in no folder": (("--figure", "no/where.svg"), ["no does not exist"]),
    "a figure where a folder is": (("--figure", "folder.svg"), ["folder.svg"]),
}


@pytest.mark.parametrize("arguments, words", BAD_ARGUMENTS.values(), ids=BAD_ARGUMENTS)
def test_a_bad_argument_is_one_line(refused, good, monkeypatch, arguments, words):
    monkeypatch.chdir(good.parent)
    (good.parent / "folder.svg").mkdir()
    line = refused("identify", good, *arguments)
    assert all(word in line for word in words)
    left = sorted(file.name for file in good.parent.iterdir())
    assert left == ["folder.svg", "probe.csv"]  # no half-written figure
