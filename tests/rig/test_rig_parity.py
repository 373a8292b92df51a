"""The simulated environment and the whole CAN path are one loop: with every kind of law, and with the same noise."""

import numpy as np
import pytest

from experiments.rig_parity import LAWS, SENSORS, WIRES, difference, episode

START = 50  # periods before rounding has come around the loop


@pytest.mark.parametrize("causality", ["impedance", "admittance"])
@pytest.mark.parametrize("name", LAWS)
def test_every_law_sees_the_same_through_frames(name, causality):
    """To within what rounding does in the loop: 0.5 mN m of a command decide between two steps of a sensor.

    Until that has come around, the same draws give the same readings; those of another period would give the same one
    in half of the periods. Catches noise that is not shared or a period late, another estimate on the rig, a lost
    period. The commands differ by what a law makes of one step of 0.03 N m.
    """
    simulated = episode(causality, name, 1.0, 3, None, noisy=True)
    real = episode(causality, name, 1.0, 3, WIRES["no time"], noisy=True)
    found = difference(name, causality, "same noise", "no time", simulated, real)
    assert np.ptp(simulated[:, 0]) > 100.0 * SENSORS.angle_step
    assert np.ptp(simulated[:START, 1]) >= SENSORS.torque_step  # the noise is there
    same = np.isclose(real[:START, 1], simulated[:START, 1], atol=1e-6)
    assert np.mean(same) > 0.8
    assert found.angle_quanta < 5.5
    assert found.torque_quanta < 6.5
    assert found.command_Nm < 0.25


def test_other_noise_is_seen():
    """The test above can fail: with other draws half of the readings differ from the first period on."""
    one, other = (episode("impedance", "pid", 1.0, seed, None, noisy=True) for seed in (3, 4))
    assert np.mean(np.isclose(one[:START, 1], other[:START, 1], atol=1e-6)) < 0.7
