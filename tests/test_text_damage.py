"""Damaged texts: what is read of them is whole, what is not is said, and nothing else happens."""

import gzip
import random

import numpy as np
import pytest
from recordings import rows_of, text_of, written

from palpate import RecordingError, open_recording

PLAIN = text_of(rows_of())
WRITTEN = {
    "plain": PLAIN.encode(),
    "gzip": gzip.compress(PLAIN.encode(), mtime=0),
    "UTF-16": PLAIN.encode("utf-16"),
    "decimal commas": PLAIN.replace(",", ";").replace(".", ",").encode(),
    "vectors": PLAIN.replace("0.0", '"[0.1, 2, 3]"').encode(),
    "notes and units": ("# probe: 7\n" + PLAIN.replace("\n", "\ns,m,N\n", 1)).encode(),
}
INSERTED = [b'"', b"\n", b",", b"\0", b"\r", b"(", b"1e", b"\xff\xfe", b"\x1f\x8b", b"# "]


def truncated(content: bytearray, chance: random.Random) -> bytes:
    return bytes(content[: chance.randrange(len(content))])


def flipped(content: bytearray, chance: random.Random) -> bytes:
    for _ in range(chance.choice([1, 5, 50, 500])):
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    return bytes(content)


def interrupted(content: bytearray, chance: random.Random) -> bytes:
    at = chance.randrange(len(content))
    content[at:at] = chance.choice(INSERTED) * chance.randrange(1, 5000)
    return bytes(content)


def with_noise(content: bytearray, chance: random.Random) -> bytes:
    at = chance.randrange(len(content))
    content[at:at] = chance.randbytes(chance.randrange(3000))
    return bytes(content)


def with_a_hole(content: bytearray, chance: random.Random) -> bytes:
    at = chance.randrange(len(content))
    del content[at : at + chance.randrange(5000)]
    return bytes(content)


@pytest.mark.parametrize("damage", [truncated, flipped, interrupted, with_noise, with_a_hole])
@pytest.mark.parametrize("content", WRITTEN.values(), ids=WRITTEN)
def test_damage_is_said_in_a_line_or_in_what_was_lost(tmp_path, content, damage):
    for seed in range(5):
        path = written(tmp_path / "d.csv", damage(bytearray(content), random.Random(seed)))
        try:
            read = open_recording(path)
        except RecordingError as error:
            words = str(error)
            assert words.replace(str(path), "").isprintable()
            assert len(words) < 700 + len(str(path))
            continue
        assert {len(values) for values in read.channels.values()} <= {len(read.rows)}
        for name, fault in read.faults.items():
            unknown = np.isnan(read.channels[name])
            assert unknown[fault.sample]
            assert 0 < fault.count <= unknown.sum()


@pytest.mark.parametrize("damage", [b'""\r\xf8', b'"a"\rb', b'"\r"\n""\r\xf8'])
def test_a_damaged_last_line_is_left_out(tmp_path, damage):
    read = open_recording(written(tmp_path / "d.csv", PLAIN.encode() + damage))
    whole = open_recording(written(tmp_path / "w.csv", PLAIN))
    assert (
        read.channels["force_N"][: len(whole.rows)].tolist() == whole.channels["force_N"].tolist()
    )
    assert any("left out" in sentence for sentence in read.losses)


@pytest.mark.parametrize(
    "notes", ["# made by: me\n", "# made by: me\n\n% of: a day\n", "sep=,\n#a: b"]
)
def test_a_table_of_notes_only_is_said_to_be_that(tmp_path, notes):
    with pytest.raises(RecordingError, match="holds notes only; expected a header and samples"):
        open_recording(written(tmp_path / "n.csv", notes))


@pytest.mark.parametrize("left", range(2, 4000, 173))
def test_of_a_file_that_was_cut_off_every_whole_row_is_read(tmp_path, left):
    """Wherever a writer was stopped: each row is one that it wrote, or it is not there."""
    begin = len(PLAIN.splitlines()[0]) + 25 * 70
    content = PLAIN.encode()[: begin + left]
    read = open_recording(written(tmp_path / "t.csv", content))
    whole = content.count(b"\n") - 1
    assert len(read.rows) in (whole, whole + 1)
    wrote = open_recording(written(tmp_path / "w.csv", PLAIN))
    for name in ("time_s", "penetration_m", "force_N"):
        assert np.array_equal(read.channels[name][:whole], wrote.channels[name][:whole])
