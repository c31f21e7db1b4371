"""Wires: order, pairs, packets, messages, addresses, and what holds of DDS, Zenoh and ZeroMQ."""

import contextlib
import json
import math
import random
import socket
import struct
import time

import numpy as np
import pytest
import zmq
from hypothesis import given
from hypothesis import strategies as st
from message_files import Maker, cdr
from scripted import resident
from wire_robots import POSE, ROBOTS, START, VECTORS, WRENCH, collect, force, free_port, position

from palpate.errors import InvalidParameterError, PalpateError
from palpate.live.ros import FORCES, POSITIONS, MessageReader
from palpate.live.sources import Counts, SourceOptions, open_source
from palpate.live.wires import (
    WAITING,
    Followed,
    Order,
    Pairing,
    Receipt,
    Stamped,
    Succession,
    WireSource,
    parse_address,
    topic_names,
)
from palpate.live.zenoh import attachment, parse_attachment
from palpate.live.zeromq import PacketError, packed, unpacked

ROS = ("dds", "zenoh")


@pytest.fixture(params=ROBOTS)
def wire(request):
    return request.param


@pytest.fixture
def robot(wire):
    made = ROBOTS[wire]()
    yield made
    made.close()


@pytest.fixture
def source(robot):
    made = robot.source()
    yield made
    made.close()
    made.close()  # may be called twice


def test_every_sample_comes_once_in_order_and_to_the_last_bit(robot, source):
    begin = time.monotonic()
    for k in range(300):
        robot.send(k)
    found = collect(source, 300)
    assert len(found) == 300
    assert [each.position for each in found] == [position(k) for k in range(300)]
    assert [each.force for each in found] == [force(k) for k in range(300)]
    for k, each in enumerate(found):
        # ZeroMQ's stamps are floats since 1970, which have steps of 0.24 µs.
        assert each.time == pytest.approx(1e-3 * k, abs=5e-7)
        assert begin <= each.there <= time.monotonic()
    assert abs(source.origin - START) < 250
    source.close()
    assert source.counts == Counts()


def test_lost_repeated_and_overtaken_samples_are_counted(robot, source):
    # 70 to 72 are missing, one is there twice, one comes too late.
    for k in (*range(70), 73, 73, 72, *range(74, 150)):
        robot.send(k)
    found = collect(source, 147, patience=1.5)
    sent = [*range(70), *range(73, 150)]
    assert [each.force for each in found] == [force(k) for k in sent]
    source.close()
    streams = 1 if source.name.startswith("zmq") else 2  # position and force are counted each
    counts = source.counts
    assert (counts.lost, counts.repeated, counts.disordered) == (3 * streams, streams, streams)


def test_a_robot_that_starts_again_is_followed(robot, source):
    stamps = [(k, START + k * 10**6) for k in range(1000, 1010)]
    # Its count begins again, with a later time; then its clock is set back.
    stamps += [(k, START + 10**13 + k * 10**6) for k in range(10)]
    stamps += [(k, START + k * 10**6) for k in range(10, 20)]
    found = []
    for k, stamp in stamps:
        robot.send(k, stamp)
        found += collect(source, 1)
    source.close()
    assert [each.force for each in found] == [force(k) for k, _ in stamps]
    assert (source.counts.lost, source.counts.disordered) == (0, 0)


@pytest.mark.long
def test_a_robot_that_goes_away_and_comes_back_is_heard_again(robot, source):
    robot.send(1)
    assert len(collect(source, 1)) == 1
    robot.close()
    assert source.take(0.6) is None  # after half a second another publisher is followed
    with contextlib.closing(robot.again()) as other:
        found, until = [], time.monotonic() + 15.0
        for k in range(100_000):  # for as long as it takes to find each other again
            other.send(k, stamp=START + 10**12 + k * 10**6)
            found += collect(source, 1, patience=0.1)
            if found or time.monotonic() > until:
                break
        assert found[0].time == pytest.approx(1000.0 + 1e-3 * k, abs=0.05)
        assert source.counts.malformed == 0


def fuzz(robot, source, count: int, first: int = 0) -> int:
    """So many packets that are no samples, with good ones in between; all are counted.

    But over DDS, where Cyclone DDS drops them before palpate sees them.
    """
    counted = not source.name.startswith("dds")
    chance, sample = random.Random(5), first
    before = source.counts.malformed
    good = robot.message(POSE, 1, START) if hasattr(robot, "message") else bytes(64)
    found = 0
    for k in range(count):
        size = chance.choice([0, 1, 3, 31, 63, 65, 200])
        junk = chance.randbytes(size)
        if k % 3 == 0:  # begins as a good one does
            junk = good[: chance.randrange(len(good))] + b"\xff" * chance.choice([0, 5, 300])
        if len(junk) in (32, 64) or len(good) <= len(junk) < len(good) + 4:
            junk += b"1234"  # of a sample's length, with padding: it would be one
        robot.junk(junk)
        if k % 50 == 49:
            robot.send(sample)
            sample += 1
            found += len(collect(source, 1))
            # Datagrams that nobody takes in time are dropped by the system itself.
            until = time.monotonic() + 5.0
            while counted and source.counts.malformed <= before + k and time.monotonic() < until:
                source.take(0.01)
    assert found == sample - first
    if counted:
        assert source.counts.malformed == before + count
        assert source.counts.last_fault
    assert (source.counts.repeated, source.counts.disordered) == (0, 0)
    return sample


def test_invalid_messages_are_counted_and_the_next_one_is_taken(robot, source):
    fuzz(robot, source, 200)


@pytest.mark.parametrize("options", ["", "?socket=pull", "?socket=pull&bind=yes"])
def test_an_invalid_packet_is_counted_and_the_next_is_taken(options):
    address = f"tcp://127.0.0.1:{free_port()}"
    with zmq.Context() as context, context.socket(zmq.PUSH if options else zmq.XPUB) as robot:
        robot.linger, robot.sndtimeo = 0, 5000  # ms: where nobody takes it, it fails
        (robot.connect if "bind" in options else robot.bind)(address)
        with contextlib.closing(open_source(f"zmq:{address}{options}")) as source:
            source.open()
            if not options:
                assert robot.recv()[:1] == b"\x01"  # it knows its subscriber
            for k in range(60):
                if k in (20, 40):
                    robot.send(bytes(100_000 if k == 20 else 30_000_000))
                if k == 50:
                    robot.send_multipart([b"topic", b"and", packed(k, 1e-3 * k, 1e-3, 0.5)])
                topic = [b"topic"] if k > 50 else []
                robot.send_multipart([*topic, packed(k, 1e-3 * k, 1e-3, 0.5)])
            assert len(collect(source, 60, patience=10.0)) == 60
            assert (source.counts.malformed, source.counts.lost) == (3, 0)
            assert source.counts.last_fault == "a message of 3 frames, not 1 or 2"


@pytest.mark.slow
def test_ten_thousand_malformed_packets_leave_the_memory_flat(robot, source):
    sample = fuzz(robot, source, 20_000)
    before = resident()
    for _ in range(4):
        sample = fuzz(robot, source, 10_000, sample)
    # The allocator takes some MB, most of it at first, until it takes no more after 70 000 packets;
    # kept packets would be 6 MB.
    assert resident() - before < 4 << 20


def test_a_source_can_be_opened_again_after_it_was_closed(wire, robot):
    for _ in range(2):
        source = robot.source()
        robot.send(5)
        assert len(collect(source, 1)) == 1
        source.close()


def listened(robot, wanted=VECTORS) -> None:
    with contextlib.closing(robot.source(wanted)) as source:
        robot.send(1)
        collect(source, 1)


@pytest.mark.parametrize("types", [(POSE, POSE), (WRENCH, WRENCH)], ids=["pose", "wrench"])
@pytest.mark.parametrize("wire", ROS)
def test_a_topic_of_the_wrong_type_is_one_clear_line(wire, types):
    with contextlib.closing(ROBOTS[wire](types=types)) as robot:
        with pytest.raises(PalpateError) as caught:
            listened(robot)
        topic = "/wrench" if types[1] == POSE else "/pose"
        assert f"topic {topic} has type {types[0]}" in str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.long
def test_connections_that_do_not_speak_the_protocol_do_no_harm():
    port, chance = free_port(), random.Random(8)
    address = f"zmq:tcp://127.0.0.1:{port}?socket=pull&bind=yes"
    with contextlib.closing(open_source(address)) as source:
        source.open()
        with pytest.raises(PalpateError, match=r"^zmq:tcp://127\.\S+: address already in use$"):
            open_source(address).open()
        for _ in range(200):
            with socket.socket() as plain:
                plain.connect(("127.0.0.1", port))
                with contextlib.suppress(ConnectionError):
                    plain.sendall(chance.randbytes(chance.randrange(300)))
        with zmq.Context() as context, context.socket(zmq.PUSH) as robot:
            robot.connect(f"tcp://127.0.0.1:{port}")
            robot.send(packed(1, 1e-3, 0.001, 0.5))
            (found,) = collect(source, 1)
    assert (found.position, found.force) == (0.001, 0.5)


MS = 1_000_000  # ns
SINCE_1970 = 1_700_000_000_000 * MS


def judged(stamps, numbers=None) -> tuple[list[int], Counts]:
    counts = Counts()
    order = Order(counts)
    numbers = [None] * len(stamps) if numbers is None else numbers
    pairs = zip(stamps, numbers, strict=True)
    taken = [k for k, pair in enumerate(pairs) if order.admit(*pair) is not Succession.REFUSED]
    order.finish_pending()
    return taken, counts


def test_gaps_in_the_stamps_are_lost_samples_at_any_rate():
    for step in (MS // 4, MS, 20 * MS):
        kept = [k for k in range(500) if k not in (3, 100, 101, 102, 490)]
        taken, counts = judged([k * step for k in kept])
        assert len(taken) == len(kept)
        assert counts.lost == 5


def test_jitter_and_pauses_are_not_lost_samples():
    # Late by up to 0.3 of a step, and some by 0.9, as those of a busy computer are.
    late = np.random.default_rng(4).uniform(0.0, 0.3, 6400)
    late[::37] = 0.9
    assert judged(((np.arange(6400) + late) * MS).astype(int).tolist())[1].lost == 0
    # A pause of the robot.
    taken, counts = judged([k * MS for k in (*range(100), *range(5000, 5100))])
    assert (len(taken), counts.lost, counts.disordered) == (200, 0, 0)
    # Too few to guess a step from; then just enough.
    assert judged([0, 5 * MS, 6 * MS])[1].lost == 0
    assert judged([0, MS, 2 * MS, 5 * MS])[1].lost == 2


def test_numbers_count_before_stamps():
    # Every other sample is missing, which no stamp tells.
    taken, counts = judged([2 * k * MS for k in range(100)], [2 * k for k in range(100)])
    assert (len(taken), counts.lost) == (100, 99)
    # A clock with steps of 4 ms: the samples are as different as their numbers.
    taken, counts = judged([k // 4 * 4 * MS for k in range(100)], list(range(100)))
    assert (len(taken), counts.lost, counts.repeated) == (100, 0, 0)
    # A sender that does not count is judged by its stamps.
    taken, counts = judged([k * MS for k in (0, 1, 2, 2, 1, 3)], [0] * 6)
    assert (taken, counts.repeated, counts.disordered) == ([0, 1, 2, 5], 1, 1)
    # A number that leaps is of another count.
    taken, counts = judged([k * MS for k in range(4)], [0, 1, 1 << 63, (1 << 63) + 1])
    assert (taken, counts.lost) == ([0, 1, 2, 3], 0)


STAMPS = st.integers(-(2**63), 2**63 - 1)


@given(st.lists(st.tuples(STAMPS, st.none() | st.integers(0, 2**64 - 1)), max_size=200))
def test_after_any_stamps_good_samples_are_taken(pairs):
    counts = Counts()
    order = Order(counts)
    refused = sum(order.admit(*pair) is Succession.REFUSED for pair in pairs)
    assert refused == counts.repeated + counts.disordered
    start = pairs[-1][0] + 2000 * MS if pairs else 0
    good = [order.admit(start + k * MS, None) for k in range(100)]
    assert Succession.REFUSED not in good
    order.finish_pending()
    assert 0 <= counts.lost <= 1_000_000 * max(len(pairs), 1) + 1000


def test_queued_samples_sent_at_once_are_not_lost():
    """A robot that is held up every now and then, for up to 0.8 s, and then hurries."""
    random = np.random.default_rng(6)
    stamps, now = [], 0
    for k in range(20_000):
        if random.uniform() < 3e-4 and k < 15_000:
            now += int(random.uniform(0.01, 0.8) * 1000 * MS)
        now = max(now + MS // 20, k * MS)
        stamps.append(now)
    assert judged(stamps)[1].lost == 0
    # And of these a hundred are lost, three times.
    kept = [stamp for k, stamp in enumerate(stamps) if k < 100 or k % 5000 >= 100]
    assert judged(kept)[1].lost == pytest.approx(300, abs=15)


def test_times_since_1970_keep_their_digits():
    def timed(*stamps):
        source = WireSource("a wire", SourceOptions())
        for stamp in stamps:
            source.give(stamp, 0.0, 0.0, 0.0)
        return [source.take(0.0).time for _ in stamps], source.origin

    since = [SINCE_1970 + k for k in (0, 1, 123_456_789)]
    assert timed(*since) == ([0.0, 1e-9, 0.123456789], SINCE_1970)
    assert timed(12_345 * MS, 12_346 * MS) == ([12.345, 12.346], 0)


@pytest.fixture
def now(monkeypatch):
    times = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: times[0])
    return times


def test_queued_samples_arrived_at_their_stamps(now):
    now[0] = 100.0
    receipt = Receipt()
    assert receipt.there(0, waited=True) == 100.0
    now[0] = 100.5  # the loop was held up for half a second
    found = [receipt.there(k * MS, waited=False) for k in (1, 2, 300)]
    assert found == pytest.approx([100.001, 100.002, 100.3])
    assert receipt.there(900 * MS, waited=False) == 100.5  # not in the future
    assert receipt.there(10 * MS, waited=False) == 100.5  # a stamp that runs back


def test_one_publisher_is_followed_until_it_is_silent(now):
    followed, accepted = Followed(), []
    for now[0], name in [(0.0, "a"), (0.0, "b"), (0.4, "a"), (0.8, "b"), (0.95, "b"), (0.95, "a")]:
        accepted.append(followed.accepts(name))
    assert accepted == [True, False, True, False, True, False]


def paired(leaders, followers, tolerance=2 * MS):
    """Times and values of the pairs, with all that counts; samples come in the order of time."""
    counts = Counts()
    pairing = Pairing(tolerance, counts)
    both = [(stamp, 0) for stamp in leaders] + [(stamp, 1) for stamp in followers]
    found = []
    for stamp, which in sorted(both, key=lambda each: each[0]):
        sample = Stamped(stamp, stamp / MS, stamp * 1e-9)
        found += (pairing.follow if which else pairing.lead)(sample, anew=False)
    return found, counts


def test_equal_stamps_pair_at_once_and_others_are_interpolated():
    found, counts = paired([k * MS for k in range(50)], [k * MS for k in range(50)])
    assert [(each.stamp, each.leader, each.follower) for each in found] == [
        (k * MS, float(k), float(k)) for k in range(50)
    ]
    assert counts.unpaired == 0
    found, counts = paired([k * MS for k in range(1, 50)], [k * MS + 300_000 for k in range(50)])
    assert [each.follower for each in found] == pytest.approx([float(k) for k in range(1, 50)])
    assert all(each.there >= each.stamp * 1e-9 for each in found)
    assert counts.unpaired == 0
    pairing = Pairing(2 * MS, Counts())  # vectors too
    pairing.follow(Stamped(0, (0.0, 1.0, 2.0), 0.0), anew=False)
    pairing.lead(Stamped(MS, (9.0, 9.0, 9.0), 0.0), anew=False)
    (pair,) = pairing.follow(Stamped(2 * MS, (2.0, 1.0, 0.0), 0.0), anew=False)
    assert (pair.follower, pair.leader) == ((1.0, 1.0, 1.0), (9.0, 9.0, 9.0))


def test_unpaired_messages_are_counted():
    # Forces at 100 Hz: a position at 1 kHz has one at most 2 ms away in half of the cases.
    found, counts = paired([k * MS for k in range(100)], [k * 10 * MS for k in range(11)])
    assert len(found) + counts.unpaired == 100
    assert len(found) == 50
    assert "0.003 s away: raise tolerance=0.002" in counts.last_fault
    # One topic alone.
    found, counts = paired([k * MS for k in range(3000)], [])
    assert (found, counts.unpaired) == ([], 3000 - WAITING)


@pytest.mark.parametrize("position, force", [(0.25, -1.5), ((0.1, 0.2, 0.3), (1.0, 2.0, math.nan))])
def test_packets_come_back_to_the_last_bit(position, force):
    vectors = isinstance(position, tuple)
    data = packed(2**64 - 1, 12.5, position, force)
    assert len(data) == (64 if vectors else 32)
    found = unpacked(data, vectors=vectors)
    assert (found.number, found.stamp) == (2**64 - 1, 12_500 * MS)
    assert repr((found.position, found.force)) == repr((position, force))


def test_json_is_taken_with_or_without_numbers():
    page = {"time": 1.5, "position": [0, 0.5, -1e-3], "force": [1, None, 3]}
    found = unpacked(json.dumps(page).encode(), vectors=True)
    assert (found.number, found.position) == (None, (0.0, 0.5, -1e-3))
    assert math.isnan(found.force[1])
    found = unpacked(b'{"number": 7, "time": 1, "position": 2, "force": 3e1}', vectors=False)
    assert found == (7, 1_000 * MS, 2.0, 30.0, None)


@pytest.mark.parametrize(
    "data, words",
    [
        (b"", "neither 32, 64, 96 nor JSON"),
        (b"{}", "JSON without time"),
        (b"[1, 2]", "JSON that is not an object"),
        (b'{"time": 1, "position": [1, 2, 3], "force": 2}', "are vectors: pass --direction"),
        (b'{"time": "1", "position": 1, "force": 2}', "a time that is not a number"),
        (b'{"time": 1, "position": true, "force": 2}', "a position that is not a number"),
        (b'{"time": NaN, "position": 1, "force": 2}', "a time that is not within"),
        (b'{"number": -1, "time": 1, "position": 1, "force": 2}', "not an unsigned 64-bit integer"),
        (b'{"time": 1e300, "position": 1, "force": 2}', "a time that is not within"),
        (b'{"time": 1, "position": 1' + b"0" * 400 + b', "force": 2}', "a position of 401 digits"),
        (b"[" * 3000, "neither"),
        (b"x" * 5000, "a packet of 5000 bytes"),
        (struct.pack("<Qddd", 1, math.nan, 1.0, 2.0), "a time that is not within"),
        (bytes(64), "are vectors: pass --direction"),
    ],
)
def test_an_invalid_packet_is_refused_with_the_reason(data, words):
    with pytest.raises(PacketError, match=words):
        unpacked(data, vectors=False)


@given(st.binary(max_size=200), st.booleans())
def test_any_bytes_are_a_sample_or_a_packet_error(data, vectors):
    try:
        found = unpacked(data, vectors=vectors)
    except PacketError:
        return
    assert isinstance(found.position, tuple) is vectors


MAKER = Maker()


def sent(kind, **fields):
    return cdr(kind, MAKER.make(kind, **fields))


@pytest.mark.parametrize("kind", sorted({**POSITIONS, **FORCES}))
def test_every_type_is_read_where_its_numbers_are(kind):
    path = {**POSITIONS, **FORCES}[kind]
    message = MAKER.make(kind)
    place = message
    for name in path.split(".") if path else ():
        place, last = getattr(place, name), name
    scalar = not hasattr(place, "x")
    if scalar:
        object.__setattr__(message, last, 2.5)
    else:
        place.x, place.y, place.z = 1.5, -2.5, 3.5
    data = cdr(kind, message)
    reader = MessageReader("/topic", kind, [path], vectors=not scalar)
    reading = reader.read(data)
    assert reading.values == ((2.5,) if scalar else ((1.5, -2.5, 3.5),))
    assert reading.stamp is None  # a stamp of zeros is none
    assert reader.read(data) == reading  # by the layout that it knows now


def test_joints_are_found_by_their_names_wherever_they_stand():
    kind = "sensor_msgs/msg/JointState"
    reader = MessageReader("/joints", kind, ["position[z]", "effort[z]"], vectors=False)
    for names in (["x", "y", "z"], ["z", "x"], ["a_long_name", "z"], ["x", "y", "z"]):
        at = names.index("z")
        positions, efforts = np.arange(len(names)) + 0.5, -1.0 * np.arange(len(names))
        fields = {"name": names, "position": positions, "effort": efforts}
        assert reader.read(sent(kind, **fields)).values == (positions[at], efforts[at])
    with pytest.raises(
        PalpateError, match=r"no field position\[z\]; the message has position\[x\]"
    ):
        reader.read(sent(kind, name=["x"], position=np.ones(1)))


@pytest.mark.parametrize(
    "kind, path, vectors, words",
    [
        (
            "geometry_msgs/msg/PoseStamped",
            "pose.place",
            True,
            "no field pose.place; the message has",
        ),
        ("geometry_msgs/msg/PoseStamped", "pose.position.z", True, "--direction needs a vector"),
        ("geometry_msgs/msg/PoseStamped", "pose.position", False, "pass --direction"),
        (
            "geometry_msgs/msg/PoseStamped",
            "header.frame_id",
            False,
            "no field header.frame_id; the message has",
        ),
        ("my_msgs/msg/Force", "force", True, "which ROS does not define"),
    ],
)
def test_a_field_that_cannot_be_read_is_refused_before_any_message(kind, path, vectors, words):
    with pytest.raises(InvalidParameterError, match=words) as caught:
        MessageReader("/topic", kind, [path], vectors=vectors)
    assert "/topic" in str(caught.value)


@given(st.binary(max_size=300))
def test_any_bytes_are_a_message_or_an_error_of_ours(data):
    try:
        reading = WRENCHES.read(data)
    except PalpateError:
        return
    assert len(reading.values[0]) == 3


WRENCHES = MessageReader("/t", "geometry_msgs/msg/WrenchStamped", ["wrench.force"], vectors=True)


def test_invented_message_layouts_are_forgotten():
    kind = "geometry_msgs/msg/PointStamped"
    reader = MessageReader("/t", kind, ["point"], vectors=True)
    for k in range(1000):
        reader.read(sent(kind, header={"frame_id": f"frame {k}"}))
    assert len(reader._known) <= 64


def test_attachments_are_those_of_rmw_zenoh():
    data = attachment(7, SINCE_1970, b"0123456789abcdef")
    assert len(data) == 33
    assert parse_attachment(data) == (7, SINCE_1970, b"0123456789abcdef")
    for other in (b"", data[:-1], data + b"x", data[:16] + b"\x11" + data[17:]):
        assert parse_attachment(other) is None


@pytest.mark.parametrize(
    "text, words",
    [
        ("/a?speed=1", r"unknown option 'speed'; known are domain"),
        ("/a?domain=1&domain=2", "duplicate option"),
        ("/a?domain=x", r"domain must be a number, not 'x'"),
        ("/a?domain=231", r"domain must be in \[0, 230\], not 231"),
        ("", "topics must have the form /pose,/wrench"),
        ("/a,/a", "topics must have the form"),
        ("/a,/b,/c", "topics must have the form"),
        ("/a//b", "not a valid topic name"),
        ("/a*", "not a valid topic name"),
        ("/1a", "not a valid topic name"),
        ("/ä", "not a valid topic name"),
    ],
)
def test_an_address_that_is_none_says_what_is_wrong(text, words):
    with pytest.raises(InvalidParameterError, match=words):  # noqa: PT012 - of any of the three
        address = parse_address("dds", text, ["domain"])
        topic_names(address, 2)
        address.whole("domain", 0, 0, 230)
