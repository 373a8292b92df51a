"""Every use is measured through the function that its command calls."""

from __future__ import annotations

from pathlib import Path

from experiments.simulate import Order, simulate
from experiments.uses_of_speed import EPISODE_S, EPISODES, SPEED_KMH, uses
from identification.campaign import read_campaign
from steer_env.testcar.parameters import VirtualCar


def test_uses_tell_how_much_driving_they_simulated(tmp_path: Path) -> None:
    """A use that simulates nothing (a motion that is known already, an episode that ends at once) would look fast."""
    simulate(Order((SPEED_KMH,), 1, 0, clean=False), VirtualCar(), tmp_path, 1, lambda *_, **__: None)
    campaign = read_campaign(tmp_path)
    (sine,) = campaign.select("steady_state")[SPEED_KMH][:1]
    driven = {name: use() for name, use in uses(campaign).items()}
    assert driven.pop("episodes under a controller, with noise") >= EPISODES * EPISODE_S  # all to their end
    assert driven.pop("a benchmark case with all its metrics") > 5.0
    assert len(driven) == 3
    for seconds in driven.values():  # the same sine, driven or predicted
        assert abs(seconds - sine.dt * sine.channels["torsion_bar_torque_Nm"].size) < 0.1
