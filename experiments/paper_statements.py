"""What the paper says about its parameters, asked of any set of rows: yes, no or partly, with a number."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from experiments import paper_peaks as peaks
from experiments.measures import half_width
from identification.frf import Floats
from steer_env.physics import linear
from steer_env.physics.assist import softening
from steer_env.plants import Reference
from steer_env.units import from_kmh, to_deg

STRAIGHT = 0.98  # R^2 from which a curve over speed is "almost linear"
SATURATED = 0.95  # share of its limit from which K_assist has saturated
OFF_CENTRE = 0.6  # share of the peak angle that stands for off-centre
YAW_INERTIA = 0.05  # Section 4.1: J_z within 5 % of its theoretical value
CONSISTENT = 0.05  # spread of the trail around its mean that counts as consistent
LOW_KMH = 45.0  # the paper's b_ref is negative below


class Finding(NamedTuple):
    """An answer ("yes", "no", "partly") and the numbers behind it."""

    verdict: str
    numbers: str


@dataclass(frozen=True)
class Subject:
    """Rows of a linear reference, speeds ascending, with what belongs to them.

    ``loops`` hold pinion angle in rad and torsion-bar torque in N m at 0.2 Hz by km/h; ``yaw_inertia`` in kg m2 is
    the theoretical one.
    """

    reference: Reference
    loops: dict[float, tuple[Floats, Floats]]
    yaw_inertia: float

    @property
    def speeds(self) -> Floats:
        """Speeds in km/h."""
        return self.column("speed_kmh")

    def column(self, name: str) -> Floats:
        """One key of the rows over speed."""
        return np.array([getattr(row, name) for row in self.reference.file.rows])

    def growth(self) -> Floats:
        """Largest real part of the eigenvalues of Eq. 10 in 1/s over speed."""
        found = []
        for speed in map(from_kmh, self.speeds):
            p = self.reference.at(speed)
            found.append(np.linalg.eigvals(linear.reference_matrices(speed, p, 1.0 + p.k_gain)[0]).real.max())
        return np.array(found)


class Statement(NamedTuple):
    """What the paper says, where, and how it is asked of a subject."""

    says: str
    where: str
    ask: Callable[[Subject], Finding]


def verdict(holds: bool, in_part: bool = False) -> str:
    """The plain word for it."""
    return "yes" if holds else "partly" if in_part else "no"


def _first_peak(s: Subject) -> Finding:
    return _peak(s, 0)


def _second_peak(s: Subject) -> Finding:
    return _peak(s, 1)


def _peak(s: Subject, which: int) -> Finding:
    found = [peaks.closed_form(s.reference, v)[which] for v in peaks.PAPER_SPEEDS_KMH]
    good = [peaks.agrees(f, peaks.PAPER_Hz[which]) for f in found]
    return Finding(verdict(all(good), any(good)), " and ".join(f"{f:.2f}" for f in found) + " Hz")


def _stable(s: Subject) -> Finding:
    growth = s.growth()
    stable = growth < 0.0
    worst = s.speeds[growth.argmax()]
    text = f"{stable.sum()} of {stable.size} speeds; slowest {growth.max():.2f} 1/s at {worst:g} km/h"
    return Finding(verdict(bool(stable.all()), bool(stable.any())), text)


def _negative_damping(s: Subject) -> Finding:
    b, low = s.column("b_ref"), s.speeds < LOW_KMH
    stable = bool((s.growth()[low] < 0.0).all())
    text = f"{_listed(b[low], 2)} N m s/rad at {_listed(s.speeds[low], 0)} km/h, {'stable' if stable else 'unstable'}"
    negative = bool((b[low] < 0.0).all())
    only_there = bool((b[~low] > 0.0).all())
    if not only_there:
        text += f"; also {_listed(b[~low & (b < 0.0)], 2)} above"
    return Finding(verdict(negative and only_there and stable, negative and stable), text)


def _damping_saturates(s: Subject) -> Finding:
    b, v = s.column("b_ref"), s.speeds
    low, high = (_slope(v[part], b[part]) for part in (v <= 60.0, v >= 75.0))
    text = f"slope {1e3 * low:.1f} up to 60 km/h, {1e3 * high:.1f} from 75 (10⁻³ N m s/rad per km/h)"
    rises = b[-1] > b[0]
    return Finding(verdict(rises and high < 0.5 * low, bool(rises)), text)


def _gain_drops(s: Subject) -> Finding:
    k = s.column("k_gain")
    middle = float(k[(s.speeds >= 45.0) & (s.speeds <= 75.0)].mean())
    drops = k[:2] < 0.9 * middle
    return Finding(
        verdict(bool(drops.all()), bool(drops.any())),
        f"{k[0]:.2f} at 15, {k[1]:.2f} at 30, {middle:.2f} at 45-75 km/h",
    )


def _inertia_lowest(s: Subject) -> Finding:
    J, v = s.column("J_ref"), s.speeds
    text = f"{J[0]:.4f} at 15 km/h, lowest {J.min():.4f} kg m² at {v[J.argmin()]:g} km/h"
    return Finding(verdict(int(J.argmin()) == 0), text)


def _inertia_bulge(s: Subject) -> Finding:
    J, v = s.column("J_ref"), s.speeds
    middle, high = J[(v >= 30.0) & (v <= 60.0)].mean(), J[v > 60.0].mean()
    return Finding(verdict(middle > 1.05 * high), f"mean {middle:.4f} at 30-60, {high:.4f} kg m² above")


def _trail(s: Subject) -> Finding:
    n_t, fast = s.column("n_t"), s.speeds > 30.0
    mean = n_t[fast].mean()
    spread = float(np.abs(n_t[fast] / mean - 1.0).max())
    rise = n_t[0] / mean - 1.0
    text = f"±{100 * spread:.1f} % above 30 km/h, {100 * rise:+.0f} % at 15 km/h"
    return Finding(verdict(spread < 2.0 * CONSISTENT and rise > 0.2, spread < 2.0 * CONSISTENT), text)


def _stiffness_straight(s: Subject) -> Finding:
    return _straight(s, "c_pin_on", "N m/rad")


def _friction_straight(s: Subject) -> Finding:
    return _straight(s, "M_fric_C", "N m")


def _straight(s: Subject, name: str, unit: str) -> Finding:
    """Whether a key rises straight with speed; extrapolated rows do not count."""
    known = np.array([name not in row for row in s.reference.file.extrapolated])
    v, y = s.speeds[known], s.column(name)[known]
    R2 = float(np.corrcoef(v, y)[0, 1] ** 2)
    rises = bool((np.diff(y) > 0.0).all())
    return Finding(
        verdict(rises and R2 > STRAIGHT, y[-1] > y[0] and R2 > 0.9),
        f"R² {R2:.3f}; {y[0]:.2f} to {y[-1]:.2f} {unit}{'' if rises else ', not rising throughout'}",
    )


def _progressive(s: Subject) -> Finding:
    v, c = s.speeds, s.column("c_pin_off")
    slopes = np.diff(c) / np.diff(v)
    return Finding(
        verdict(bool((np.diff(slopes) > 0.0).all()), bool(slopes[-1] > 2.0 * slopes[0])),
        f"slope {slopes[0]:.3f} at the low end, {slopes[-1]:.3f} N m/rad per km/h at the high end",
    )


def _hysteresis_angle(s: Subject) -> Finding:
    widths = np.array([to_deg(half_width(torque, angle)) for angle, torque in s.loops.values()])
    falls = bool((np.diff(widths) < 0.0).all())
    torque = [half_width(angle, torque) for angle, torque in s.loops.values()]
    text = f"half width {widths[0]:.1f} to {widths[-1]:.1f}° from 15 to 105 km/h"
    return Finding(
        verdict(falls, widths[-1] < widths[0]), f"{text} (in torque {torque[0]:.2f} to {torque[-1]:.2f} N m)"
    )


def _hysteresis_on_centre(s: Subject) -> Finding:
    pairs = []
    for speed in peaks.PAPER_SPEEDS_KMH:
        angle, torque = s.loops[speed]
        off = OFF_CENTRE * float(np.abs(angle).max())
        outer = 0.5 * (half_width(angle - off, torque) + half_width(angle + off, torque))
        pairs.append((half_width(angle, torque), outer))
    higher = [on > off for on, off in pairs]
    text = "; ".join(
        f"{on:.2f} against {off:.2f} N m at {v:g}" for v, (on, off) in zip(peaks.PAPER_SPEEDS_KMH, pairs, strict=True)
    )
    return Finding(verdict(all(higher), any(higher)), f"{text} km/h")


def _assist_saturates(s: Subject) -> Finding:
    shares = []
    for row, (_, torque) in zip(s.reference.file.rows, s.loops.values(), strict=True):
        r = row.c_pin_off / row.c_pin_on
        limit = max(r, 1e-12)
        shares.append(limit / softening(float(np.abs(torque).max()), r, row.sigma_assist))
    share, v = np.array(shares), s.speeds
    reached = share > SATURATED
    count = f"at {reached.sum()} of {reached.size} speeds ({_listed(v[reached], 0)} km/h)"
    text = f"{count}; {_listed(100 * share, 0)} % of c_on/c_off"
    return Finding(verdict(bool(reached.all()), bool(reached.any())), text)


def _yaw_inertia(s: Subject) -> Finding:
    off = float(np.abs(s.column("J_z") / s.yaw_inertia - 1.0).max())
    return Finding(verdict(off <= YAW_INERTIA + 1e-6), f"at most {100 * off:.1f} % off {s.yaw_inertia:.0f} kg m²")


def _slope(x: Floats, y: Floats) -> float:
    return float(np.polyfit(x, y, 1)[0])


def _listed(values: Floats, digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values).replace("-", "−") or "none"


STATEMENTS = (
    Statement("First peak of angle/torque around 1.5 Hz (90 and 75 km/h)", "4.1", _first_peak),
    Statement("Second peak, of rate/torque, at about 4 Hz (90 and 75 km/h)", "4.1", _second_peak),
    Statement("All eigenvalues of Eq. 10 lie in the left half plane", "4.1", _stable),
    Statement("b_ref < 0 below 45 km/h, and still stable", "4.1", _negative_damping),
    Statement("b_ref rises with speed and saturates", "4.1", _damping_saturates),
    Statement("Linearised assist gain drops at low speeds", "4.1", _gain_drops),
    Statement("J_ref is lowest at 15 km/h", "4.1", _inertia_lowest),
    Statement("J_ref is higher at 30 to 60 km/h than above", "4.1", _inertia_bulge),
    Statement("Trail is consistent above 30 km/h and larger below", "4.1", _trail),
    Statement("J_z within 5 % of its theoretical value", "4.1", _yaw_inertia),
    Statement("c_pin,on almost linear in speed", "4.1", _stiffness_straight),
    Statement("c_pin,off progressive in speed", "4.1", _progressive),
    Statement("M_fric,C grows almost linearly with speed", "4.1", _friction_straight),
    Statement("Steering hysteresis shrinks with speed", "4.1", _hysteresis_angle),
    Statement("On-centre friction torque above off-centre", "4.1", _hysteresis_on_centre),
    Statement("K_assist saturates within the driven torque", "3.5.1", _assist_saturates),
)
