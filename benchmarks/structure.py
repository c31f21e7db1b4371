"""How the code is cut: lengths of files and functions, public names, bytes of the estimators.

``python -m benchmarks.structure [--root CHECKOUT]`` counts a checkout; this one unless named.
"""

import ast
import statistics
import subprocess
from collections.abc import Iterable
from pathlib import Path

from cyclopts import App

from benchmarks.native_programs import BuildError, native_programs

HERE = Path(__file__).resolve().parents[1]
app = App(name="python -m benchmarks.structure", help_format="plaintext")


def _functions(path: Path) -> Iterable[tuple[int, str]]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield (node.end_lineno or node.lineno) - node.lineno + 1, node.name


def _lengths(title: str, found: list[tuple[int, str]]) -> None:
    longest = max(found)
    median = statistics.median(length for length, _ in found)
    print(f"{title}: {len(found)}, median {median:g} lines, longest {longest[0]} ({longest[1]})")


def _files(root: Path, folder: str, ending: str) -> list[Path]:
    return sorted(path for path in (root / folder).rglob(f"*{ending}") if path.name != "_core.pyi")


def _public_names(root: Path) -> list[str]:
    package = root / "src" / "palpate"
    face = next(p for p in (package / "_public.py", package / "__init__.py") if p.exists())
    for node in ast.parse(face.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return list(ast.literal_eval(node.value))
    return []


@app.default
def structure(*, root: Path = HERE) -> None:
    """Count files and functions of a checkout and, of this one, the estimators' bytes.

    Parameters
    ----------
    root
        The checkout.
    """
    for title, folder, ending in (("C++ headers", "include", ".hpp"), ("Python", "src", ".py")):
        files = [
            (path.read_text(encoding="utf-8").count("\n"), str(path.relative_to(root)))
            for path in _files(root, folder, ending)
        ]
        _lengths(f"{title}, files", files)
    _lengths(
        "Python, functions",
        [each for path in _files(root, "src", ".py") for each in _functions(path)],
    )
    print(f"public names of palpate: {len(_public_names(root))}")
    if root.resolve() != HERE:
        return
    try:
        sizes = subprocess.run(
            [native_programs().sizes], capture_output=True, text=True, check=True
        ).stdout
    except BuildError as error:
        print(f"bytes of the estimators: {error}")
        return
    for line in sizes.splitlines():
        name, plain, detecting, rejecting = line.split()
        words = f"{detecting} with a change detector, {rejecting} with a rejection of outliers too"
        print(f"{name}: {plain} bytes, {words}")


if __name__ == "__main__":
    app()
