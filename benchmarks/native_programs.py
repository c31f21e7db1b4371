"""Build the native references: a C++ replay, a C++ loop and an empty compiled method."""

import importlib.util
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

SOURCE = Path(__file__).parent / "native"
BUILD = SOURCE.parents[1] / "build" / "benchmarks"


class BuildError(Exception):
    """The native programs could not be built, for the reason in the message."""


@dataclass(frozen=True)
class NativePrograms:
    """The built programs."""

    replay: Path
    preparation: Path
    empty_method: Any
    compiler: str


@cache
def native_programs() -> NativePrograms:
    """Configure and build with CMake, optimised as the extension is.

    Raises
    ------
    BuildError
        There is no CMake, compiler or nanobind, or the build failed.
    """
    nanobind = _output([sys.executable, "-m", "nanobind", "--cmake_dir"])
    settings = {
        "CMAKE_BUILD_TYPE": "Release",
        "nanobind_DIR": nanobind,
        "Python_EXECUTABLE": sys.executable,
    }
    given = [f"-D{name}={value}" for name, value in settings.items()]
    _output(["cmake", "-S", str(SOURCE), "-B", str(BUILD), *given])
    _output(["cmake", "--build", str(BUILD), "--config", "Release"])
    modules = sorted(BUILD.glob("empty_method*.so")) + sorted(BUILD.glob("empty_method*.pyd"))
    if not modules:
        raise BuildError("the build made no empty_method module")
    compiler = (BUILD / "compiler.txt").read_text().strip()
    replay, preparation = (BUILD / name for name in ("replay", "preparation"))
    return NativePrograms(replay, preparation, _loaded(modules[0]), compiler)


def _output(command: list[str]) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except FileNotFoundError:
        raise BuildError(f"{command[0]} is not installed") from None
    except subprocess.CalledProcessError as error:
        last = (error.stderr or error.stdout).strip().splitlines()[-1:]
        raise BuildError(f"{' '.join(command[:3])} failed: {' '.join(last)}") from None
    return done.stdout.strip()


def _loaded(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location("empty_method", path)
    if spec is None or spec.loader is None:
        raise BuildError(f"{path.name} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
