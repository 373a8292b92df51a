"""A sealed frame opens once, unchanged, under the right key, and in no other case."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steer_env.errors import InputError
from steer_env.rig.authentication import AuthenticatedLink, Opener, Sealer
from steer_env.rig.frame import Frame, Received

KEY = bytes(range(32))
FRAME = Frame(0x201, b"\x2e\xfb\x2c\x01\x0a\x00\x11\x00")
FRAMES = st.builds(
    Frame, st.integers(0, 0x7FF), st.binary(max_size=8), st.just(False), st.just(False), st.just(False)
) | st.builds(Frame, st.integers(0, 2**29 - 1), st.binary(max_size=45), st.just(True), st.just(True), st.just(False))


@settings(max_examples=200, deadline=None, derandomize=True)
@given(frame=FRAMES, bit=st.integers(0, 64 * 8 - 1), start=st.integers(1, 2**63))
def test_what_is_sealed_opens_unchanged_and_no_flipped_bit_is_believed(frame, bit, start):
    sealed = Sealer(KEY, lambda: start).seal(frame)
    data = bytearray(sealed.data)
    data[bit // 8 % len(data)] ^= 1 << bit % 8
    assert Opener(KEY, 0).open(sealed._replace(data=bytes(data))) == "wrong authentication code"
    assert Opener(KEY, 0).open(sealed) == frame


def test_nothing_opens_twice_or_out_of_order_or_from_before():
    sealer, opener = Sealer(KEY, lambda: 100), Opener(KEY, 99)
    first, second, third = (sealer.seal(FRAME) for _ in range(3))
    assert opener.open(second) == FRAME
    assert opener.open(second) == "played back"
    assert opener.open(first) == "played back"
    assert opener.open(third) == FRAME
    assert Opener(KEY, 100).open(first) == "played back"


def test_a_sender_that_starts_anew_is_believed_and_its_recorded_past_is_not():
    opener = Opener(KEY, 0)
    old = Sealer(KEY, lambda: 1000).seal(FRAME)
    assert opener.open(old) == FRAME
    assert opener.open(Sealer(KEY, lambda: 2000).seal(FRAME)) == FRAME
    assert opener.open(old) == "played back"


def test_another_key_identifier_or_a_plain_frame_is_not_believed():
    sealed = Sealer(KEY).seal(FRAME)
    assert Opener(KEY[::-1], 0).open(sealed) == "wrong authentication code"
    assert Opener(KEY, 0).open(sealed._replace(identifier=0x202)) == "wrong authentication code"
    assert Opener(KEY, 0).open(sealed._replace(extended=True)) == "wrong authentication code"
    assert Opener(KEY, 0).open(sealed._replace(data=sealed.data[:12])) == "not a sealed frame"
    assert Opener(KEY, 0).open(FRAME) == "not a sealed frame"


def test_a_short_key_and_too_much_data_are_refused():
    with pytest.raises(InputError, match="bytes"):
        Sealer(b"short")
    with pytest.raises(InputError, match="bytes"):
        Opener(b"short", 0)
    with pytest.raises(ValueError, match="48 bytes"):
        Sealer(KEY).seal(Frame(1, bytes(48), fd=True))


class Wire:
    """A link that gives back what was sent, once."""

    def __init__(self):
        self.frames = []

    def send(self, frame):
        self.frames.append(frame)
        return True

    def receive(self, timeout):
        return Received(self.frames.pop(0), 1.0, 2.0) if self.frames else None


def test_a_link_of_sealed_frames_drops_what_it_cannot_believe():
    wire = Wire()
    link = AuthenticatedLink(wire, KEY, 0)
    assert link.send(FRAME)
    assert wire.frames[0].data != FRAME.data
    wire.frames.append(FRAME)  # injected
    wire.frames.append(wire.frames[0])  # played back
    assert link.receive(0.0) == Received(FRAME, 1.0, 2.0)
    assert link.receive(0.0) is None
    assert link.receive(0.0) is None
    assert link.receive(0.0) is None
    assert link.rejected == 2
