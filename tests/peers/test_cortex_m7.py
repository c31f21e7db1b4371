"""The headers on a Cortex-M7 without an operating system, under QEMU, against this machine.

Debian has it: ``apt-get install gcc-arm-none-eabi libstdc++-arm-none-eabi-newlib qemu-system-arm``.
"""

import os
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.peers

SOURCES = Path(__file__).with_name("cortex_m7")
INCLUDE = Path(__file__).parents[2] / "include"
CROSS, QEMU = "arm-none-eabi-", "qemu-system-arm"
PLAIN = ["-O2", "-ffp-contract=off"]
CORTEX = ["-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-d16", "-mfloat-abi=hard", "-Wno-psabi", *PLAIN]
CPP = ["-std=c++20", "-fno-exceptions", "-fno-rtti", f"-I{INCLUDE}"]


def run(*command: object) -> str:
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def answers(text: str) -> dict[str, tuple[int, list[float]]]:
    """The size and the numbers of each method."""
    rows = (line.split() for line in text.splitlines())
    return {
        name: (int(size), [struct.unpack(">d", bytes.fromhex(each))[0] for each in numbers])
        for name, size, *numbers in rows
    }


def test_the_ball_is_identified_on_a_cortex_m7_as_here(tmp_path):
    """To 1e-12, which the elementary functions of two C libraries leave; 1 kB for single stage."""
    compiler = os.environ.get("CXX", "c++")
    needed = (compiler, f"{CROSS}g++", QEMU)
    missing = [each for each in needed if shutil.which(each) is None]
    if missing:
        pytest.skip(f"no {', '.join(missing)}")
    start, here, there = (tmp_path / name for name in ("start.o", "here", "there"))
    run(f"{CROSS}gcc", *CORTEX, "-c", SOURCES / "start.c", "-o", start)
    link = [
        "-fno-threadsafe-statics",
        start,
        "-T",
        SOURCES / "memory.ld",
        "--specs=rdimon.specs",
        "-nostartfiles",
    ]
    run(f"{CROSS}g++", *CORTEX, *CPP, SOURCES / "ball.cpp", *link, "-o", there)
    run(compiler, *PLAIN, *CPP, SOURCES / "ball.cpp", "-o", here)
    machine = ["-M", "mps2-an500", "-nographic", "-semihosting-config", "enable=on,target=native"]
    native, cortex = answers(run(here)), answers(run(QEMU, *machine, "-kernel", there))
    assert list(native) == list(cortex) == ["single-stage", "variable-projection", "viscoelastic"]
    for name, (size, numbers) in cortex.items():
        assert size == native[name][0]
        assert numbers == pytest.approx(native[name][1], rel=1e-12, abs=0.0), name
    assert cortex["single-stage"][0] <= 1024
