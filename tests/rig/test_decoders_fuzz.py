"""A short run of the fuzz experiment, and proof that it can see a decoder that believes too much or too little."""

import pytest

from experiments import rig_fuzz, rig_oracles
from steer_env.rig.frame import Frame
from steer_env.rig.motors import MOTORS
from steer_env.rig.motors.motor import DriveStatus, Sample
from steer_env.rig.motors.senso_wheel import SensoWheel


@pytest.mark.parametrize("name", list(MOTORS))
def test_no_decoder_believes_a_frame_that_says_nothing(name):
    """Wrong length, identifier or kind, values that are not finite, impossible states, a wrong checksum."""
    found = rig_fuzz.fuzz(name, 4000, seed=1)
    assert found.accepted_wrongly == found.refused_wrongly == 0, found.example
    assert found.believed > 200  # the run did see good frames
    assert found.rejected > 200


def test_every_motor_has_an_oracle():
    assert set(rig_oracles.ORACLES) == set(MOTORS) == set(rig_oracles.SETTINGS)


@pytest.mark.parametrize("fault", ["believes any length", "off by a bit", "believes nothing"])
def test_the_fuzz_notices_a_bad_decoder(fault, monkeypatch):
    """Three decoders with a fault each; a fuzz that lets them pass proves nothing."""
    honest = SensoWheel.decode

    def decode(self, frame: Frame):
        if fault == "believes nothing":
            return ()
        if fault == "believes any length" and frame.identifier == 0x211:
            frame = frame._replace(data=(frame.data + bytes(8))[:8])
        said = honest(self, frame)
        if fault == "off by a bit":
            said = tuple(m._replace(angle=m.angle + 1.6e-4) if isinstance(m, Sample) else m for m in said)
        return said

    monkeypatch.setattr(SensoWheel, "decode", decode)
    found = rig_fuzz.fuzz("senso_wheel", 2000, seed=1)
    assert found.accepted_wrongly + found.refused_wrongly > 10


def test_a_status_that_differs_from_the_layout_is_noticed():
    assert not rig_fuzz.agrees([DriveStatus("on")], rig_oracles.Truth(state="error"))
    assert not rig_fuzz.agrees([DriveStatus("on")], None)
    assert rig_fuzz.agrees([DriveStatus("on")], rig_oracles.Truth(state="on"))
