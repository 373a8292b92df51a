"""The super-twisting algorithm for a loop behind a delay: gains from a bound, poles no faster than the delay allows.

For s' = u + d with |d'| <= L (Levant 1993),

    u = -k1 sqrt(|s|) sign(s) + v,     v' = -k2 sign(s)

brings s and s' to zero in finite time and holds them there. With z = (sqrt(|s|) sign(s), v + d) this
is |z1| z' = A z + B d' |z1|, A = [[-k1/2, 1/2], [-k2, 0]], and the circle criterion (Moreno, Osorio
2012) asks for |G(jw)| < 1 / L, G = 1/2 / (w0^2 + k1/2 jw - w^2), w0^2 = k2/2. For k1^2 >= 4 k2 the
largest |G| is that at w = 0, so that k2 > L is enough. Levant's own condition (1998),
k1^2 >= 4 L (k2 + L) / (k2 - L), asks at k1^2 = 4 k2 for k2 >= (1 + sqrt 2) L. Here k1 = 2 sqrt(k2)
and k2 = MARGIN L, which meets both.

Discretised by matched poles (Koch, Reichhartinger 2019): for a given s the algorithm is linear, with
poles at -w twice, w = sqrt(k2 / |s|). With z = exp(-w h) and c = (1 - z) / h,

    u = -2 c s + v,     v <- v - h c^2 s

has poles z twice on s <- s + h (u + d): no chatter from sampling, however near s comes to zero. A
delay T_d bounds w instead of the period: w = min(sqrt(k2 / |s|), ``fastest``). That is a boundary
layer of k2 / fastest^2, inside of which the algorithm is a PI controller that no delay below about
1 / (2 fastest) makes oscillate; outside its gain only falls.

Levant, Int. J. Control 58(6) 1993 and Automatica 34(3) 1998; Moreno, Osorio, IEEE TAC 57(4) 2012;
Koch, Reichhartinger, Automatica 107 2019.
"""

from __future__ import annotations

import math

from steer_env.physics._jit import scalar

MARGIN = 2.5  # k2 / L, above 1 + sqrt(2)


@scalar
def pole(s: float, k2: float, fastest: float) -> float:
    """Local pole w in 1/s of the algorithm at a sliding variable; k2 in its unit per s2."""
    size = abs(s)
    if size * fastest * fastest <= k2:
        return fastest
    return math.sqrt(k2 / size)


@scalar
def twist_step(s: float, v: float, k2: float, fastest: float, period: float) -> tuple[float, float]:
    """(u, next v): what drives s' in its unit per s, for a sliding variable ``s``."""
    gain = (1.0 - math.exp(-pole(s, k2, fastest) * period)) / period
    return v - 2.0 * gain * s, v - period * gain * gain * s
