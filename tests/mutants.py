"""One-line defects, mutants, that the fast tests notice: no deletion of tests may lose one.

Usage, in an environment with the extra test, cmake, ninja and nanobind::

    python tests/mutants.py choose          # fill tests/mutants.json up to 8 + 16 mutants
    python tests/mutants.py check [TEXT]    # does a test fail for each (whose file has TEXT)?

A mutant swaps an operator, swaps min and max, or doubles a constant, in one line. ``choose`` draws
lines by ``SEED``, and keeps a mutant if a test that is related to its file fails for it; it records
the others as dropped. It can go on after an interruption, and replaces mutants that are gone.
``check`` finds a line by its text, in whatever file it stands by now, and tries the recorded test,
the related ones, then all fast tests. It reports ``killed by TEST``, ``survived`` or ``gone:
replace it``, records new tests and files, and exits 1 if a mutant survives. A test counts if it
fails for the mutant twice and passes without it. Both work on a temporary copy of this tree, and
compile the extension there, in less time with ``CMAKE_CXX_COMPILER_LAUNCHER=ccache``.
"""

import json
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import nanobind  # type: ignore[import-untyped]

SEED = 27
MEMORY = 8 << 30  # bytes, of each process: a mutant may want more than there is
TREE = Path(__file__).resolve().parents[1]
RECORD = TREE / "tests" / "mutants.json"
Mutant = dict[str, str]

# How many of which folders, no two of one file. "loose" are the files in the root itself, which in
# Python are those of the identification.
WANTED = {
    "include": {"loose": 2, "projection": 2, "viscoelastic": 2, "methods": 1, "curves": 1},
    "src": dict.fromkeys(["results", "fleet", "cli", "exports"], 1)
    | dict.fromkeys(["recordings", "preparation", "diagnosis", "estimators", "loose", "live"], 2),
}
# Not drawn from: engines without which their tests are skipped.
UNDRAWN = re.compile(
    r"exports/(drake|opensim|usd)|cli/(completion|config|help|layout|printing|progress)"
)
# Not counted as related: tests of documents, of whole runs, and of what is not installed.
UNFIT = re.compile(
    r"browser|damage|doc|endurance|fuzz|help|hostile|notebooks|paper|peers|process_end|running"
)
PYTEST = [sys.executable, "-m", "pytest", "-x", "-q", "-n2", "-ocache_dir=cache"]
WIDE = [
    "tests/cli/test_cli.py",
    "tests/identification/test_identification.py",
    "tests/estimators/test_conformance.py",
]

SWAPS = {"<": "<=", ">": ">=", "+": "-", "*": "/", "and": "or", "&&": "||", "min": "max"}
SWAPS |= {new: old for old, new in SWAPS.items()}
SWAPPED = re.compile(
    r"(?<!\S)(?:[<>]=?|[-+*/]|and|or|&&|\|\|)(?!\S)|\b(?:min|max)(?=\()|(?<![\w.])\d+\.\d+(?![\w.])"
)
# Loops that would not end, what is decided when compiling, and lines with a string or a comment.
UNTOUCHED = re.compile(r"for \(|while|static|constexpr|using |operator|template|[\"'#]|//")
# A return, a condition, a constant, an assignment: in C++ they stand in functions only.
STATEMENT = re.compile(r"(return|(} else )?if|const \w+( \w+)? =|[^\s{]+ [-+*/]?=) .*[;{]$")
# How the copy is imported, and not what an editable install points to.
BEFORE_AN_EDITABLE_INSTALL = """import sys
sys.meta_path = [finder for finder in sys.meta_path if "ScikitBuild" not in str(finder)]
"""

TEXTS = {
    path.relative_to(TREE).as_posix(): path.read_text("utf-8")
    for pattern in ("include/**/*.hpp", "src/palpate/**/*.py", "tests/**/test_*.py")
    for path in sorted(TREE.glob(pattern))
}
LINES = {file: [line.strip() for line in text.split("\n")] for file, text in TEXTS.items()}
FOLDERS = {file: (file.split("/")[2:-1] or ["loose"])[0] for file in TEXTS}


def candidates(root: str) -> list[Mutant]:
    """Return what can be tried, in the order of ``SEED``."""
    files = [file for file in LINES if file.startswith(root)]
    count = Counter(line for file in files for line in LINES[file])
    found = []
    for file in (file for file in files if not UNDRAWN.search(file)):
        code = re.sub(r'""".*?"""', '"', TEXTS[file], flags=re.DOTALL)
        for line in map(str.strip, code.split("\n")):
            # A line that stands nowhere else is found again when it has moved.
            if count[line] != 1 or UNTOUCHED.search(line):
                continue
            for swapped in SWAPPED.finditer(line) if root == "src" or STATEMENT.match(line) else ():
                new = SWAPS.get(swapped[0]) or repr(2.0 * float(swapped[0]))
                changed = line[: swapped.start()] + new + line[swapped.end() :]
                found += [{"file": file, "line": line, "replacement": changed}] * (new != "0.0")
    random.Random(SEED).shuffle(found)
    return found


def with_query(mutants: list[Mutant], dropped: list[Mutant]) -> Iterator[Mutant]:
    """Yield what to try next, as long as the mutants are fewer than wanted."""
    for root, wanted in WANTED.items():
        for mutant in candidates(root):
            files = [located(old) for old in mutants if old["file"].startswith(root)]
            folder = FOLDERS[mutant["file"]]
            full = [FOLDERS[file] for file in files].count(folder) >= wanted.get(folder, 0)
            known = any(mutant.items() <= old.items() for old in dropped)
            if not full and not known and mutant["file"] not in files:
                yield mutant


def located(mutant: Mutant) -> str:
    """Return the file that has the mutant's line by now; empty if none has."""
    files = [mutant["file"], *(file for file in LINES if file[:3] == mutant["file"][:3])]
    return next((file for file in files if mutant["line"] in LINES.get(file, ())), "")


def related(file: str) -> list[str]:
    """Return the tests that name the module or what it defines, and some that see everything."""
    within = [user for user in LINES if f'/{Path(file).name}"' in TEXTS[user]]  # including headers
    folders = " ".join([file, *within]).replace("include/palpate/", "").replace("src/palpate/", "")
    parts = {part for part in re.split(r"\W|_", folders) if len(part) > 3}
    words = {Path(file).stem, *re.findall(r"(?m)^(?:class|struct|def) (\w+)", TEXTS[file])}
    named = Counter[str]()
    for test in (test for test in LINES if test.startswith("tests") and not UNFIT.search(test)):
        named[test] = sum(word in TEXTS[test] for word in words)
        named[test] += 4 * sum(part in test for part in parts)
    return list(dict.fromkeys([test for test, score in named.most_common(6) if score] + WIDE))


class Trial:
    """A copy of this tree, in which mutants are put, compiled, and tried."""

    def __init__(self, folder: str) -> None:
        self.tree = Path(folder, "tree")
        unneeded = shutil.ignore_patterns(".git", ".venv", "build", "*.so", ".*_cache")
        shutil.copytree(TREE, self.tree, ignore=unneeded)
        (self.tree / "src" / "sitecustomize.py").write_text(BEFORE_AN_EDITABLE_INSTALL)
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        self.environment = os.environ | {"PATH": path, "PYTHONPATH": f"{self.tree}/src"}
        self.environment |= {"CCACHE_BASEDIR": f"{self.tree}", "CCACHE_NOHASHDIR": "1"}
        options = ["PALPATE_PYTHON=ON", "CMAKE_BUILD_TYPE=Release"]
        options += [f"Python_EXECUTABLE={sys.executable}", f"nanobind_DIR={nanobind.cmake_dir()}"]
        options += [f"CMAKE_LIBRARY_OUTPUT_DIRECTORY={self.tree}/src/palpate"]
        self.ran("cmake", "-GNinja", "-Bbuild", *[f"-D{option}" for option in options])
        if not self.ran("cmake", "--build", "build"):
            sys.exit("The extension does not compile, even without a mutant.")

    def ran(self, *command: str) -> bool:
        """Run a command in the copy; return whether it succeeded, within half an hour."""
        limited = ("timeout", "--kill-after=9", "1800", *command)
        done = subprocess.run(limited, cwd=self.tree, env=self.environment, capture_output=True)
        return done.returncode == 0

    def put(self, file: str, text: str) -> bool:
        """Write a file of the copy; return whether it compiles."""
        (self.tree / file).write_text(text, "utf-8")
        return file.endswith(".py") or self.ran("cmake", "--build", "build")

    def failing(self, *tests: str) -> str:
        """Return the first of the tests that fails; empty if none does."""
        record = self.tree / "cache" / "v" / "cache" / "lastfailed"
        record.unlink(missing_ok=True)
        self.ran(*PYTEST, *tests)
        failed = json.loads(record.read_text("utf-8")) if record.exists() else {}
        return next((test for test in failed if "::" in test), "")

    def outcome(self, mutant: Mutant) -> str:
        """Return what becomes of the mutant, and write down in it which test killed it."""
        if not (file := located(mutant)):
            return "gone: replace it"
        mutant["file"], compiles = file, True
        stages = [related(file)]
        if "killer" in mutant:
            stages = [[mutant["killer"]], *stages, ["tests"]]
        rows, row = TEXTS[file].split("\n"), LINES[file].index(mutant["line"])
        rows[row] = rows[row].replace(mutant["line"], mutant["replacement"])
        for tests in stages:
            compiles = self.put(file, "\n".join(rows))
            test = self.failing(*tests) if compiles else ""
            test = test and self.failing(test)
            if self.put(file, TEXTS[file]) and test and self.ran(*PYTEST, test):
                mutant["killer"] = test
                return f"killed by {test}"
        return "survived" if compiles else "does not compile"


def main(command: str = "", text: str = "") -> int:
    """Do what the command says, and record it mutant by mutant."""
    if command not in ("choose", "check"):
        sys.exit(__doc__)
    record: dict[str, list[Mutant]] = json.loads(RECORD.read_text("utf-8"))
    tried: Iterable[Mutant] = [mutant for mutant in record["mutants"] if text in mutant["file"]]
    if command == "choose":
        record["mutants"] = [mutant for mutant in record["mutants"] if located(mutant)]
        tried = with_query(**record)
    outcomes = Counter[str]()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(folder)
        for mutant in tried:
            outcome = trial.outcome(mutant)
            if command == "choose" and "killer" in mutant:
                record["mutants"].append(mutant)
            elif command == "choose":
                record["dropped"].append(mutant | {"outcome": outcome})
            RECORD.write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n", "utf-8")
            outcomes[outcome.partition(" by")[0]] += 1
            change = f"{mutant['line']}\n  → {mutant['replacement']}"
            print(f"{mutant['file']}: {change}\n  {outcome}", flush=True)
    print(*(f"{count} {outcome}" for outcome, count in outcomes.items()), sep=", ")
    return int(command == "check" and outcomes["survived"] > 0)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
