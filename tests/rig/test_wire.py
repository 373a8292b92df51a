"""A bus cannot carry more than it can, and the lowest identifier goes first."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steer_env.rig.frame import Frame
from steer_env.rig.virtual.wire import QUEUE, Wire, classic_bits, frame_time, priority

MEGABIT = 1_000_000


def bits(frames: list[Frame], stuffed: bool) -> int:
    return sum(classic_bits(frame, stuffed) for frame in frames)


def test_loads_that_were_computed_elsewhere():
    """Bits per cycle without and with worst stuffing: wheel 222..270, ODrive 190..230, CANopen with SYNC 237..285."""
    wheel = [Frame(0x201, bytes(8)), Frame(0x211, bytes(8))]
    odrive = [Frame(0x02E, bytes(4)), Frame(0x029, bytes(8))]
    canopen = [Frame(0x080, b""), Frame(0x201, bytes(4)), Frame(0x181, bytes(8))]
    for frames, bare, worst in ((wheel, 222, 270), (odrive, 190, 230), (canopen, 237, 285)):
        assert (bits(frames, False), bits(frames, True)) == (bare, worst)


def test_lengths_of_classic_frames():
    """Field by field: SOF, id 11, RTR, IDE, r0, DLC 4, CRC 15, then 10 and 3; 29 bits: SRR, id 18, r1 more."""
    assert classic_bits(Frame(0, b""), False) == 1 + 11 + 3 + 4 + 15 + 1 + 2 + 7 + 3 == 47
    assert classic_bits(Frame(0, bytes(8), extended=True), False) == 47 + 20 + 64
    assert classic_bits(Frame(0, bytes(8), extended=True), True) == 47 + 20 + 64 + 29
    assert classic_bits(Frame(0, b"", remote=True), True) == 47 + 33 // 4


def test_an_fd_frame_is_faster_than_its_bits_at_the_nominal_rate():
    """48 bytes at 1 and 5 Mbit/s: at least 384 data bits at 0.2 us and 30 bits at 1 us, at most a third more."""
    command = Frame(0x8001, bytes(48), extended=True, fd=True)
    least = 384 * 0.2e-6 + (36 + 13 + 3) * 1e-6
    assert least < frame_time(command, MEGABIT, 5 * MEGABIT) < 1.34 * least
    assert frame_time(command, MEGABIT) > 384e-6


frames = st.builds(
    Frame,
    identifier=st.integers(0, 0x7FF),
    data=st.binary(max_size=8),
    extended=st.booleans(),
    fd=st.just(False),
    remote=st.booleans(),
)


@settings(max_examples=100, deadline=None)
@given(queues=st.lists(st.lists(frames, max_size=30), min_size=1, max_size=5))
def test_what_is_carried_takes_its_time(queues):
    """Nodes that always have something to say: no frame is lost, doubled or faster than its bits."""
    wire = Wire(MEGABIT)
    for node, queue in enumerate(queues):
        assert all(wire.queue(str(node), frame, 0.0) for frame in queue)
    sent = []
    while wire.due() < float("inf"):
        sent.append(wire.complete())
    for node, queue in enumerate(queues):
        assert [each.frame for each in sent if each.node == str(node)] == queue  # each node's own order
    ends = [each.time for each in sent]
    assert ends == sorted(ends)
    if sent:
        assert ends[-1] == pytest.approx(bits([each.frame for each in sent], True) / MEGABIT, rel=1e-9)
        assert wire.busy == pytest.approx(ends[-1])


def test_the_lowest_identifier_goes_first_and_the_short_form_wins():
    wire = Wire(MEGABIT)
    wire.queue("first", Frame(0x700, bytes(8)), 0.0)  # has the wire already
    late = [Frame(0x201 << 18, b"", extended=True), Frame(0x300, b""), Frame(0x201, b""), Frame(0x080, b"")]
    for node, frame in enumerate(late):
        wire.queue(str(node), frame, 1e-6)
    order = [wire.complete().frame for _ in range(5)]
    assert [frame.key for frame in order] == [
        (0x700, False), (0x080, False), (0x201, False), (0x201 << 18, True), (0x300, False),
    ]  # fmt: skip
    assert (
        priority(Frame(0x201, b""))
        < priority(Frame((0x201 << 18) + 1, b"", extended=True))
        < priority(Frame(0x202, b""))
    )


def test_a_node_that_is_never_heard_refuses_in_the_end():
    wire = Wire(MEGABIT)
    taken = [wire.queue("host", Frame(0x201, bytes(8)), 0.0) for _ in range(QUEUE + 5)]
    assert taken.count(True) == QUEUE + 1  # one is on the wire
    assert wire.refused == 4
    wire.drop("host")
    assert wire.queue("host", Frame(0x201, bytes(8)), 0.0)


def test_an_ideal_wire_takes_no_time_and_keeps_the_order():
    wire = Wire(0)
    for k in range(5):
        wire.queue("host", Frame(0x700 - k, b""), 0.5)
    sent = [wire.complete() for _ in range(5)]
    assert [each.frame.identifier for each in sent] == [0x700 - k for k in range(5)]
    assert {each.time for each in sent} == {0.5}
