"""No command writes over what it reads, whichever option names it, or into a folder of it."""

from pathlib import Path

import pytest

from palpate.cli import application

#: What each command needs besides the two options of a test; FILE is a recording.
NEEDED = {
    "identify": ["FILE"], "diagnose": ["FILE"], "compare": ["FILE"], "info": ["FILE"],
    "payload": ["FILE"], "skew": ["FILE"], "live": ["FILE"], "fleet": ["FILE", "-o", "results"],
    "lab": ["hunt-crossley", "-o", "new.csv"], "map": ["results"],
    "export": ["result", "--to", "physx"], "gains": ["result", "--controller", "force"],
    "design": ["FILE", "--noise", "1"], "explain": [],
}  # fmt: skip
# Positional texts and texts of options that may name files, besides all options of type Path.
TEXTS = {"live": ["SOURCE"], "fleet": ["SOURCES"], "lab": ["MATERIAL", "--trajectory"]}
FOR_ONE = "fleet", "--save-config"  # it refuses the option before it looks at its value
FOLDERS = {"identify", "fleet", "export"}  # their -o


def _options(command):
    """The options of a command that name an input, and those that name an output."""
    inputs, outputs = [*TEXTS.get(command, []), "--config"], []
    for each in application.application([command])[command].assemble_argument_collection():
        if "pathlib.Path" in str(each.hint) or each.hint is Path:
            found = outputs if each.field_info.name in application.OUTPUTS else inputs
            found.append(each.names[0])
    return inputs, outputs


OPTIONS = {command: _options(command) for command in NEEDED}
PAIRS = [
    (command, given, written)
    for command, (inputs, outputs) in OPTIONS.items()
    for given in inputs
    for written in outputs
]


def _call(command, given, path, written, target):
    words = [str(path) if word == "FILE" and given.isupper() else word for word in NEEDED[command]]
    if command == "lab" and given.isupper():
        words[0] = str(path)
    if given in ("RESULT", "RESULTS"):
        words[0] = str(path)
    if not given.isupper():
        words += [given, str(path)]
    if command == "fleet" or (command, written) == ("lab", "--output"):
        del words[words.index("-o") : words.index("-o") + 2]
    return [command, *words, written, str(target)]


def test_every_command_and_kind_of_path_is_in_the_table():
    assert set(NEEDED) == set(application.COMMANDS)
    assert {written for _, _, written in PAIRS} == {
        "--output", "--figure", "--picture", "--record", "--ros-parameters", "--save-config",
    }  # fmt: skip
    named = {given for _, given, _ in PAIRS}
    assert named >= {"FILES", "FILE", "LOG", "--with", "--payload", "--config", "--model"}


@pytest.mark.parametrize("command, given, written", PAIRS)
def test_no_output_replaces_an_input(command, given, written, refused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("FILE").write_text("time_s,penetration_m,force_N\n", encoding="utf-8")
    # A suffix that fits the output, and a name that a folder of results has.
    folder = written == "--output" and command in FOLDERS
    scene = "--trajectory" in TEXTS.get(command, []) and given == "MATERIAL"
    path = tmp_path / ("run.toml" if folder else "in.xml" if scene else "in.svg")
    before = b"# palpate did not write this\n"
    path.write_bytes(before)
    link = tmp_path / "link.svg"
    link.symlink_to(path)
    names = {each.name for each in tmp_path.iterdir()}
    words = refused(*_call(command, given, path, written, tmp_path if folder else link))
    assert path.read_bytes() == before
    assert {each.name for each in tmp_path.iterdir()} == names
    if not (folder or given in ("RESULT", "RESULTS") or (command, written) == FOR_ONE):
        assert "this is an input file" in words


@pytest.mark.parametrize(
    "command, given, written", [each for each in PAIRS if each[1].startswith(("F", "L", "S"))]
)
@pytest.mark.parametrize("named", ["bag", "bag/metadata.yaml", "set/data/chunk-000/file.parquet"])
def test_nothing_is_written_into_a_bag_or_a_data_set(
    named, command, given, written, refused, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    for each in ("bag/metadata.yaml", "set/data/chunk-000/file.parquet", "set/meta/info.json"):
        Path(each).parent.mkdir(parents=True, exist_ok=True)
        Path(each).write_text("{}", encoding="utf-8")
    before = sorted(tmp_path.rglob("*"))
    target = Path(named.partition("/")[0]) / "new.svg"
    words = refused(*_call(command, given, named, written, target))
    assert "inside an input folder" in words or command == "fleet"
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    "command, option",
    [(command, option) for command in ("identify", "diagnose", "compare", "payload")
     for option in ("--save-config", "--ros-parameters") if option in OPTIONS[command][1]],
)  # fmt: skip
def test_only_what_palpate_wrote_is_replaced(command, option, refused, tmp_path, good):
    mine = tmp_path / "mine"
    mine.write_bytes(b"at = 3\n")
    assert "palpate did not write this file" in refused(command, good, option, mine)
    assert mine.read_bytes() == b"at = 3\n"
