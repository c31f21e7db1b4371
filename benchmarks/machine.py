"""The machine of a measurement."""

import datetime
import importlib.metadata
import os
import platform
from pathlib import Path

import palpate

PACKAGES = (
    "palpate",
    "numpy",
    "nanobind",
    "padasip",
    "filterpy",
    "statsmodels",
    "mcap",
    "rosbags",
    "mujoco",
    "drake",
    "opensim",
)


def describe(compiler: str) -> dict[str, str]:
    """Return processor, system, Python, compiler, packages and date, as text."""
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
    return {
        "processor": f"{_processor()}, {os.cpu_count()} cores, load {load} before the run",
        "system": _system(),
        "Python": f"{platform.python_implementation()} {platform.python_version()}",
        "compiler": compiler,
        "packages": ", ".join(f"{name} {_version(name)}" for name in PACKAGES),
        "date": datetime.date.today().isoformat(),
    }


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text().splitlines():
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                return value.strip()
    return platform.processor() or platform.machine()


def _system() -> str:
    try:
        name = platform.freedesktop_os_release()["PRETTY_NAME"]
    except (OSError, KeyError):
        name = platform.system()
    return f"{name}, {platform.machine()}"


def _version(package: str) -> str:
    if package == "palpate":
        return palpate.__version__
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "absent"
