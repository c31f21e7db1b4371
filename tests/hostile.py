"""A corpus of hostile recordings, made anew from fixed seeds, and what becomes of each.

    python hostile.py FOLDER SEED COUNT

writes so many of them, or all for 0, one after the other into a folder, opens each, and prints a
line of JSON for it. It is a process of its own: one that hangs ends itself with a traceback after
ten seconds, and one that dies is seen from outside.
"""

import contextlib
import faulthandler
import io
import json
import random
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from hostile_files import Variant, corpus

from palpate import PalpateError, RecordingError, cli, prepare
from palpate.recordings import open_recording
from palpate.recordings.survey import survey

STATUS = Path("/proc/self/status")

SECONDS = 10  # that any file may take

# What a file may take beyond three times its size: what bounds.py lets any file unpack to, twice,
# since that much is packed and unpacked at once, and the libraries that are imported on the way.
MEMORY = 256 << 20


def same(one, other) -> bool:
    """Whether two recordings hold the same."""
    return one.channels.keys() == other.channels.keys() and all(
        np.array_equal(values, other.channels[name], equal_nan=values.dtype.kind == "f")
        for name, values in one.channels.items()
    )


def outcome(variant: Variant, path: Path, chance: random.Random) -> str:
    """What becomes of a file: an outcome of the allowed ones, or words on what is wrong."""
    try:
        recording = open_recording(path)
        survey(recording)
        said = bool(recording.losses or recording.faults or recording.omissions)
    except PalpateError as error:
        return "refused" if len(str(error).splitlines()) == 1 else f"not one line: {error}"
    with contextlib.suppress(RecordingError):
        prepare(recording)
    if chance.random() < 0.15 and (words := by_command(path)):
        return words
    if variant.exact and not said and not same(recording, open_recording(variant.clean)):
        return "silently less than the clean file"
    return "read, and said" if said else "read"


def by_command(path: Path) -> str:
    """What is wrong with how the commands end; nothing where that is allowed."""
    for command in (["info", str(path)], ["identify", str(path)]):
        out, err, status = io.StringIO(), io.StringIO(), 0
        sys.argv = ["palpate", *command]
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                cli.main()
            except SystemExit as end:
                status = int(end.code or 0)
        lines = err.getvalue().splitlines()
        if (status, len(lines)) not in ((0, 0), (2, 1)) or "Traceback" in err.getvalue():
            return f"{command}: status {status}: {err.getvalue()!r}"
    return ""


def memory(field: str) -> int:
    """What this process takes (VmRSS), or took at most of late (VmHWM), bytes."""
    if not STATUS.exists():  # only Linux tells, and forgets
        return 0
    [line] = [line for line in STATUS.read_text().splitlines() if line.startswith(field)]
    return int(line.split()[1]) * 1024


def forget_peak() -> None:
    if STATUS.exists():
        (STATUS.parent / "clear_refs").write_text("5")


def judge(folder: Path, variants: list[Variant]) -> Iterator[dict[str, object]]:
    """Make and open each; yield what became of it."""
    for number, variant in enumerate(variants):
        path = folder / f"{number}{variant.suffix}"
        variant.make(path)
        size = path.stat().st_size if path.is_file() else 0
        forget_peak()
        before, began = memory("VmRSS"), time.monotonic()
        faulthandler.dump_traceback_later(SECONDS, exit=True)
        print(json.dumps({"begins": variant.name}), flush=True)
        try:
            words = outcome(variant, path, random.Random(variant.name))
        except Exception as error:
            words = f"a traceback: {error!r}"
        faulthandler.cancel_dump_traceback_later()
        taken, seconds = memory("VmHWM") - before, time.monotonic() - began
        if taken > 3 * size + MEMORY:
            words = f"{taken >> 20} MB of memory for {size} bytes"
        yield {"name": variant.name, "outcome": words, "seconds": seconds, "bytes": taken}
        if path.is_dir() and not path.is_symlink():
            path.rmdir()
        else:
            path.unlink(missing_ok=True)


if __name__ == "__main__":
    warnings.simplefilter("error")
    place, seed, wanted = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    everything = corpus(place)
    chosen = random.Random(seed).sample(everything, wanted) if wanted else everything
    for line in judge(place, chosen):
        print(json.dumps(line), flush=True)
