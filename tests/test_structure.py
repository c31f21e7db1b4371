"""The shape of the house: imports run one way, and a noun is one class."""

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

import palpate

HOME = Path(palpate.__file__).parent

#: From the ground up. A package imports from those below it only, at the top of a file, inside a
#: function and for type checking.
FLOORS = (
    "_core spelling _plugins _headers method input output", "errors",
    "validation digits writing stages",
    "rows settings force_laws findings", "contact", "estimators", "recordings", "channels",
    "wrench", "preparation", "diagnosis", "quantities", "identification", "results", "figures",
    "reports", "identifying", "lab", "control_loops fleet exports", "_public", "palpate", "live",
    "cli", "__main__",
)  # fmt: skip
FLOOR = {name: k for k, names in enumerate(FLOORS) for name in names.split()}


@cache
def tree(path):
    """The syntax tree of a file, parsed once for all tests."""
    return ast.parse(path.read_text(encoding="utf-8"))


def modules():
    """Every module by its name."""
    for path in sorted(HOME.rglob("*.py")):
        parts = ["palpate", *path.relative_to(HOME).with_suffix("").parts]
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


@cache
def imports():
    """Who imports whom, by modules."""
    return list(_imports())


def _imports():
    known = dict(modules())
    for name, path in known.items():
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Import):
                yield from ((name, each.name) for each in node.names if "palpate" in each.name)
            elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("palpate"):
                for each in node.names:
                    below = f"{node.module}.{each.name}"
                    yield name, below if below in known or each.name == "_core" else node.module


#: Folders of the second level: a package in them counts by its own name.
GROUPS = ("method", "input", "identification", "output")


def package(module):
    """The package of a module: the first part of its name that is on a floor, from the inside."""
    parts = module.split(".")[1:3] if "." in module else [module]
    if parts[0] in GROUPS and parts[-1] in FLOOR:
        return parts[-1]
    return parts[0]


def test_no_import_runs_upward():
    between = {(package(a), package(b), a, b) for a, b in imports() if package(a) != package(b)}
    upward = sorted(f"{a} imports {b}" for x, y, a, b in between if FLOOR[x] <= FLOOR[y])
    assert not upward
    assert len(between) > 500  # they were found at all


def test_the_groups_of_packages_import_one_way():
    crossing = {(a.split(".")[1], b.split(".")[1]) for a, b in imports() if "." in a and "." in b}
    order = {group: place for place, group in enumerate(GROUPS)}
    upward = {(a, b) for a, b in crossing if order.get(a, 9) < order.get(b, -1)}
    assert not upward
    assert ("output", "method") in crossing  # they were found at all


def test_no_imports_go_round_in_a_circle():
    below = defaultdict(set)
    for name, imported in imports():
        below[name].add(imported)
    done = set()

    def follow(name, path):
        assert name not in path, " → ".join([*path[path.index(name) :], name])
        if name not in done:
            for each in sorted(below[name]):
                follow(each, [*path, name])
            done.add(name)

    for name in sorted(below):
        follow(name, [])


#: What turns a recording or a sample into laws, numbers and marks, and shows them; and what hangs
#: on it, with the number of names that each limb takes without their being public. It may fall.
LIMBS = {"exports": 0, "lab": 0, "control_loops": 1, "live": 9, "fleet": 18}
TRUNK = {*FLOOR} - {*LIMBS} - {"palpate", "_public", "cli", "__main__"}
# Formats of numbers and files, errors and findings: the vocabulary of every package.
VOCABULARY = {"errors", "validation", "digits", "findings", "writing", "stages"}


def public_names():
    nodes = ast.walk(tree(HOME / "_public.py"))
    return {each.asname for n in nodes if isinstance(n, ast.ImportFrom) for each in n.names}


def names_taken(limb):
    """The names that are not public which a limb takes from other packages."""
    public, taken = public_names(), set()
    for path in (HOME / limb).rglob("*.py"):
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.Import):
                pairs = [(each.name, "") for each in node.names]
            elif isinstance(node, ast.ImportFrom):
                pairs = [(node.module, each.name) for each in node.names]
            else:
                continue
            for module, name in pairs:
                home = name if module == "palpate" else package(module)
                if module.split(".")[0] == "palpate" and home not in {limb, *VOCABULARY}:
                    taken |= {(module, name)} if name not in public else set()
    return taken


def test_a_limb_takes_public_names_from_the_trunk_and_few_others():
    assert {limb: len(names_taken(limb)) for limb in LIMBS} == LIMBS


def test_the_trunk_imports_no_limb_and_a_limb_no_other():
    between = {(package(a), package(b)) for a, b in imports()}
    assert not {(a, b) for a, b in between if a in TRUNK and b in LIMBS}
    crossing = {(a, b) for a, b in between if a in LIMBS and b in LIMBS and a != b}
    public = ("lab", "control_loops")  # modules
    assert crossing <= {(limb, module) for limb in LIMBS for module in public}
    lab = {module for a, module in imports() if package(a) in LIMBS if package(module) == "lab"}
    assert "palpate.lab" in lab  # they were found at all


def test_every_class_name_occurs_once():
    nouns = defaultdict(list)
    for name, path in modules():
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ClassDef):
                nouns[node.name].append(name)
    assert not {noun: places for noun, places in nouns.items() if len(places) > 1}


# What the reproduction of the paper needs that has no public name: the style of figures and pages,
# files written completely or not at all, interrupts held back, and the check for MuJoCo.
WITHOUT_A_PUBLIC_NAME = {
    "palpate.output.figures.style", "palpate.output.reports", "palpate.output.reports.html",
    "palpate.writing", "palpate.fleet.running", "palpate.errors",
}  # fmt: skip


def test_the_reproduction_of_the_paper_uses_public_names():
    public = {*palpate.__all__, "__version__", "lab"}
    internal = set()
    for path in (Path(__file__).parents[1] / "paper").glob("*.py"):
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ImportFrom) and node.module.startswith("palpate"):
                names = {each.name for each in node.names}
                if node.module == "palpate" and names <= public:
                    continue
                assert not [name for name in names if name.startswith("_")], path.name
                if node.module != "palpate.lab":
                    internal.add(node.module)
    assert internal == WITHOUT_A_PUBLIC_NAME


def test_each_check_has_one_file_that_writes_its_sentences():
    homes = defaultdict(set)
    for name, path in modules():
        for check in re.findall(r"\bCheck\.([A-Z0-9_]+)\.finding\(", path.read_text()):
            homes[check].add(name)
    assert not {check: names for check, names in homes.items() if len(names) > 1}
    assert len(homes) > 50  # they were found at all


def test_no_decision_compares_the_id_of_a_check_with_a_literal():
    literal = re.compile(r"\.check\s+(?:==|!=|in|not in)\s+[\"'(\[{]+[\"']|\bFinding\(\s*[\"']")
    found = [name for name, path in modules() if literal.search(path.read_text())]
    assert not found
