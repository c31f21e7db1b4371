"""Writing files: whole or not at all, through what is no regular file, never over what is read."""

import errno
import os
import re
import stat
import threading
from pathlib import Path

import pytest
from payloads import PAYLOAD
from ruamel.yaml import YAML

from palpate import RecordingError, writing
from palpate.exports.ros_parameters import ros_parameters
from palpate.fleet.card import Card
from palpate.writing import check_outputs, check_writable, make_folder, write_bytes, write_text

OLD, NEW = b"old", b"new" * 100_000
FULL = Path("/dev/full")
devices = pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")
a_user = pytest.mark.skipif(os.geteuid() == 0, reason="root may write to anything")


@pytest.fixture
def old(tmp_path):
    path = tmp_path / "old.csv"
    path.write_bytes(OLD)
    return path


def test_a_new_file_follows_the_umask_and_a_replaced_one_its_mode(tmp_path):
    # Of a name as long as the system takes.
    for path, mode in ((tmp_path / "new.csv", 0o640), (tmp_path / (255 * "x"), 0o604)):
        mask = os.umask(0o027)
        try:
            check_writable(path)
            write_bytes(path, OLD)
        finally:
            os.umask(mask)
        assert stat.S_IMODE(path.stat().st_mode) == 0o640
        path.chmod(mode)
        write_bytes(path, NEW)
        assert (path.read_bytes(), stat.S_IMODE(path.stat().st_mode)) == (NEW, mode)
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files away")
def test_a_file_that_is_replaced_keeps_its_owner(old):
    os.chown(old, 12345, 54321)
    write_bytes(old, NEW)
    assert (old.stat().st_uid, old.stat().st_gid) == (12345, 54321)


@a_user
def test_a_protected_file_is_left_alone(old):
    old.chmod(0o444)
    for attempt in (lambda: check_writable(old), lambda: write_bytes(old, NEW)):
        with pytest.raises(RecordingError, match="Permission denied"):
            attempt()
    assert old.read_bytes() == OLD


@pytest.mark.parametrize("target", ["old.csv", "folder/absent.csv"])
def test_writing_follows_links_and_creates_folders(old, target):
    old.with_name("folder").mkdir()
    link = old.with_name("link.csv")
    link.symlink_to(target)
    check_writable(link)
    write_bytes(link, NEW)
    assert link.is_symlink()
    assert (old.parent / target).read_bytes() == NEW


def test_a_named_pipe_is_written_through_to(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    found = []
    reader = threading.Thread(target=lambda: found.append(pipe.read_bytes()), daemon=True)
    reader.start()
    check_writable(pipe)
    write_bytes(pipe, NEW)
    reader.join(10.0)
    assert found == [NEW]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@devices
def test_a_device_is_written_through_to_and_says_when_it_is_full():
    before = FULL.stat().st_ino
    check_writable(FULL)
    with pytest.raises(RecordingError, match="/dev/full: No space left on device; free some space"):
        write_bytes(FULL, NEW)
    write_bytes(Path("/dev/null"), NEW)
    assert FULL.is_char_device()
    assert FULL.stat().st_ino == before
    check_outputs([Path("/dev/null"), Path("/dev/null")], [Path("/dev/null")])


def names_of(old: Path) -> list[Path]:
    """One file by its own name, a relative one, a symbolic link and a hard link."""
    symbolic, hard = old.with_name("symbolic.csv"), old.with_name("hard.csv")
    symbolic.symlink_to(old)
    hard.hardlink_to(old)
    (old.parent / "folder").mkdir()
    return [old, old.parent / "folder" / ".." / old.name, symbolic, hard]


def test_no_output_replaces_an_input_or_another_output(old):
    for name in names_of(old):
        for attempt in (lambda name=name: check_writable(name, [old]),
                        lambda name=name: write_bytes(name, NEW, [old]),
                        lambda name=name: write_text(name, "new", [old])):  # fmt: skip
            with pytest.raises(RecordingError, match="this is an input file"):
                attempt()
        with pytest.raises(RecordingError, match="two outputs name this file"):
            check_outputs([old, name])
    assert old.read_bytes() == OLD
    new = old.with_name("new.csv")
    with pytest.raises(RecordingError, match="two outputs name this file"):
        check_outputs([new, old.parent / "folder" / ".." / "new.csv"])
    check_outputs([new, old])
    assert not new.exists()


def test_a_file_is_on_disk_before_it_replaces_another(old, monkeypatch):
    synced = []

    def note(descriptor):
        synced.append((stat.S_IFMT(os.fstat(descriptor).st_mode), old.read_bytes()))

    monkeypatch.setattr(os, "fsync", note)
    write_bytes(old, NEW)
    assert synced == [(stat.S_IFREG, OLD), (stat.S_IFDIR, NEW)]


@pytest.mark.parametrize("end", [OSError(errno.ENOSPC, "No space left on device"),
                                 KeyboardInterrupt()], ids=repr)  # fmt: skip
def test_a_failed_write_keeps_the_old_file(old, monkeypatch, end):
    def fail(descriptor):
        raise end

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises((RecordingError, KeyboardInterrupt)):
        write_bytes(old, NEW)
    assert old.read_bytes() == OLD
    assert list(old.parent.iterdir()) == [old]


REFUSED = {
    "a folder": ("folder", "this is a folder; name a file in it"),
    "in no folder": ("absent/x.csv", "the folder .*absent does not exist"),
    "below a file": ("old.csv/x.csv", "Not a directory"),
    "a link to itself": ("loop.csv", "symbolic link"),
    "too long": (300 * "x", "File name too long"),
    "of a null byte": ("a\0b", "not a valid file name"),
    "of a lone surrogate": ("a\ud800b", "not a valid file name"),
}


@pytest.mark.parametrize("name, words", REFUSED.values(), ids=REFUSED)
def test_an_unwritable_name_is_refused_before_the_work(old, name, words):
    (old.parent / "folder").mkdir()
    (old.parent / "loop.csv").symlink_to("loop.csv")
    before = sorted(old.parent.iterdir())
    for attempt in (check_writable, lambda path: write_bytes(path, NEW)):
        with pytest.raises(RecordingError, match=words):
            attempt(old.parent / name)
    assert sorted(old.parent.iterdir()) == before


def test_a_folder_is_made_with_those_above_it(tmp_path, old):
    make_folder(tmp_path / "a" / "b")
    make_folder(tmp_path / "a" / "b")
    assert not list((tmp_path / "a" / "b").iterdir())
    with pytest.raises(RecordingError, match="this is not a folder"):
        make_folder(old)


def test_text_is_utf_8_whatever_it_quotes(tmp_path):
    write_text(tmp_path / "note.txt", "μ\n\udcff")
    assert (tmp_path / "note.txt").read_bytes() == "μ\n\\udcff".encode()


def test_only_this_module_opens_files_to_write():
    package = Path(writing.__file__).parent
    for path in set(package.rglob("*.py")) - {Path(writing.__file__)}:
        code = path.read_text(encoding="utf-8")
        for name in (".write_text(", ".write_bytes(", 'open("w', "mkstemp(", "NamedTemporaryFile("):
            assert name not in code, path


def test_a_name_is_shown_as_text_and_never_executed(tmp_path):
    name = "<img src=x>|[a](b) `c` \x1b[2J\x9b1m \u202egnp"
    card = Card(name, (("source", name),), (name,), ((name, "failed", name),), name)
    writing.write_text(tmp_path / "card.md", card.markdown)
    text = (tmp_path / "card.md").read_text("utf-8")
    assert all(sign.isprintable() for sign in text.replace("\n", ""))
    assert not re.search(r"(?<!\\)[<\[`]", text)
    [row] = [line for line in text.splitlines() if "failed" in line]
    assert len(re.findall(r"(?<!\\)\|", row)) == 4
    frame = 'a: {b}\n# "c"\x1b \U0001f600'
    parameters = YAML(typ="safe").load(ros_parameters(PAYLOAD, sensor_frame=frame))
    chain = parameters["/**"]["ros__parameters"]["sensor_filter_chain"]
    assert chain["filter1"]["params"]["sensor_frame"] == frame
