"""Bad input on the command line: one line that says what and where, exit status 2, no traceback."""

import shlex
from pathlib import Path

import pytest
from recordings import text_of, written
from test_csv import changed

RECORDINGS = Path(__file__).parents[1] / "examples" / "recordings"
NAMED = {
    "BALL": str(RECORDINGS / "ball.csv"),
    "GUESS": "--stiffness 2000 --damping 2000 --exponent 1",
    "HALF-SPACE": "generalised-hunt-crossley --stiffness 8000 --exponent 1.5 --damping 60",
}
#: Of each command line words that its one line has.
REFUSED = {
    "identify": ["FILES"],
    "press": ["press"],
    "identif --help": ["identif", 'Did you mean "identify"?'],
    "identify absent.csv": ["absent.csv: No such file or directory"],
    "identify 'two\nlines.csv'": ["No such file"],
    "identify folder.svg": ["folder.svg: the folder holds no bag"],
    "compare bad.csv --strict --dark --figure out.svg": ["bad.csv: ", "row 5"],
    "diagnose bad.csv --strict --json": ["bad.csv: ", "row 5"],
    "info bad.h5": ["no HDF5 file"],
    "identify -- -v": ["-v: No such file or directory; check the path"],
    "identify probe.csv --config none.toml": ["none.toml: No such file"],
    "identify probe.csv --config folder.svg": ["folder.svg: ", "Is a directory"],
    "identify probe.csv --config": ["--config requires an argument"],
    # What is no option, or no value of one.
    "identify probe.csv --surfce fit": ["--surfce", "Did you mean --surface?"],
    "identify probe.csv --start soon": ["--start", "soon"],
    "identify probe.csv --at 3kg": ["--at must be a number and one of m, cm, mm"],
    "identify probe.csv --delay soon": ["--delay must be a number and one of s, ms"],
    "identify probe.csv --tare 2": ["--tare must be START:STOP"],
    "identify probe.csv --unit mm": ["--unit must be CHANNEL=UNIT"],
    "identify probe.csv --unit force=MPa": ["unit of the force must be one of N"],
    "identify probe.csv --frequency 5parsec": ["--frequency must be a number and one of Hz, rad/s"],
    # Laws and methods.
    "identify probe.csv --method spring": ["method must be one of", "single-stage", "'spring'"],
    "identify probe.csv --law springy": ["law must be one of hunt-crossley, auto, any"],
    "identify probe.csv --law auto --method single-stage": ["do not go together"],
    "identify probe.csv --law auto --surface estimate": ["is for a method that can"],
    "identify probe.csv --method single-stage --surface estimate": ["not for single-stage"],
    "identify BALL --frequency 500Hz -o out": ["band of the motion"],
    "identify BALL --law auto --frequency 500Hz -o out": ["band of the motion"],
    # Samples of which none is left.
    "identify probe.csv --start 5": ["no sample between 5 s", "0.599 s"],
    "identify probe.csv --min-force -1": ["minimum_force", "-1"],
    "identify probe.csv --min-penetration 1": ["never touches", "above 1 m"],
    "identify probe.csv --velocity-window -1": ["-1"],
    "identify probe.csv --force Fz": ["no column 'Fz'", "force_N", "name others"],
    # Figures.
    "identify probe.csv --figure out.eps": ["out.eps", "end in .svg, .pdf or .png"],
    "identify probe.csv --figure no/where.svg": ["no does not exist"],
    "identify probe.csv --figure folder.svg": ["folder.svg"],
    # Other commands.
    "design GUESS": ["--noise"],
    "design GUESS --noise loud": ["loud"],
    "design GUESS --noise 1 --amplitudes 1e-3": ["as many, not 1 and 3"],
    "design GUESS --noise 1 --sample-time 1": ["frequencies[0] must be in"],
    "lab bal -o x.csv": ["MATERIAL must be one of ball, sponge"],
    "lab ball -o x.csv --trajectory sines": ["must be one of three-sines, two-sines"],
    "lab ball -o x.csv --trajectory gone.csv": ["gone.csv: No such file"],
    "lab ball -o x.csv --probe finger": ["finger"],
    "lab ball -o x.csv --noise -1": ["force_noise must be in"],
    "lab ball -o x.csv --stiffness 3": ["--stiffness goes with a law of one's own"],
    "lab hunt-crossley -o x.csv --stiffness 3": ["needs --stiffness, --damping, --exponent"],
    "lab HALF-SPACE -o x.csv": ["--damping-exponent, may have --relaxation-stiffness"],
    "lab HALF-SPACE --damping-exponent 0.5 --relaxation-stiffness 3 -o x.csv": [
        "longest_time must be above 0"
    ],
    "lab ball -o x.csv --picture rig.bmp": ["must end in .svg, .pdf or .png"],
    "lab ball -o x.csv --picture rig.svg --probe ideal": ["an ideal probe has none"],
    "lab ball -o absent/x.csv --seconds 90000": ["absent"],
    "lab ball -o . --seconds 90000": ["this is a folder"],
    "lab ball -o o.svg --picture o.svg --seconds 90000": ["two outputs would be this file"],
    "lab ball --probe ideal -o probe.csv --trajectory probe.csv": ["this file is read"],
    "paper --only fig05 fig99": ["fig99", "--only", "fig05, fig06"],
    "paper --only fig05 -o probe.csv/below": ["probe.csv/below"],
    "paper --workers 0": ["--workers", "0"],
}


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("words", REFUSED)
def test_what_cannot_be_is_refused_in_a_line_and_nothing_is_written(refused, good, words):
    if words.startswith(("lab", "paper")):
        pytest.importorskip("mujoco", reason="needs MuJoCo: pip install 'palpate[lab]'")
    written(good.with_name("bad.csv"), changed(3, 0, "0.0015"))
    written(good.with_name("bad.h5"), bytes(1000))
    good.with_name("folder.svg").mkdir()
    there = contents(good.parent)
    command = [part for word in shlex.split(words) for part in NAMED.get(word, word).split(" ")]
    line = refused(*command)
    assert all(expected in line for expected in REFUSED[words])
    assert contents(good.parent) == there


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
