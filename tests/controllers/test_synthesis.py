"""H-infinity synthesis against a closed form and another way to a norm; truncation and sampling by their bounds."""

import numpy as np
import pytest
from scipy.optimize import brentq

from controllers.synthesis import (
    BACKED_OFF,
    CLOSE,
    Controller,
    Problem,
    bilinear,
    closed,
    peak,
    response,
    synthesise,
    truncated,
)
from steer_env.errors import InputError

ONE = np.ones((1, 1))


def scalar_problem(a):
    """x' = a x + w_1 + u, z = (x, u), y = x + w_2."""
    return Problem(
        A=a * ONE,
        B1=np.array([[1.0, 0.0]]),
        B2=ONE,
        C1=np.array([[1.0], [0.0]]),
        C2=ONE,
        D12=np.array([[0.0], [1.0]]),
        D21=np.array([[0.0, 1.0]]),
    )


def random_problem(seed, n=6):
    rng = np.random.default_rng(seed)
    D12, D21 = np.zeros((3, 1)), np.zeros((2, 4))
    D12[-1], D21[:, 2:] = 0.5, np.diag([0.3, 2.0])
    C1 = np.vstack([rng.standard_normal((2, n)), np.zeros((1, n))])
    B1 = np.hstack([rng.standard_normal((n, 2)), np.zeros((n, 2))])
    return Problem(
        rng.standard_normal((n, n)), B1, rng.standard_normal((n, 1)), C1, rng.standard_normal((2, n)), D12, D21
    )


def norm_of(A, B, C):
    """H-infinity norm by bisection: below it the Hamiltonian matrix has eigenvalues on the imaginary axis."""
    low, high = 1e-6, 1e6
    while high > 1.00001 * low:
        g = np.sqrt(low * high)
        values = np.linalg.eigvals(np.block([[A, B @ B.T / g**2], [-C.T @ C, -A.T]]))
        crosses = np.abs(values.real).min() < 1e-8 * np.abs(values).max()
        low, high = (g, high) if crosses else (low, g)
    return high


@pytest.mark.parametrize("a", [-2.0, 0.5, 3.0])
def test_the_least_gamma_of_a_scalar_problem(a):
    """Both Riccati equations are 2 a X - (1 - 1/g^2) X^2 + 1 = 0, and the least g has X = g.

    Catches a wrong sign, a missed coupling of the two, a gamma that is not the least.
    """

    def over(g):
        return 1.0 / (np.sqrt(a * a + 1.0 - 1.0 / g**2) - a) - g

    start = 1.0 if a > 0.0 else 1.0 / np.sqrt(1.0 + a * a)
    lowest = brentq(over, start * (1.0 + 1e-9), 100.0)
    _, gamma = synthesise(scalar_problem(a))
    assert lowest <= gamma / BACKED_OFF <= lowest * CLOSE


@pytest.mark.parametrize("seed", range(4))
def test_the_loop_keeps_the_gamma_that_is_reported(seed):
    """Catches an observer form that is not the central controller, a grid that misses the peak."""
    p = random_problem(seed)
    k, gamma = synthesise(p)
    A, B, C = closed(p, k)
    assert np.linalg.eigvals(A).real.max() < 0.0
    exact = norm_of(A, B, C)
    assert 0.5 * gamma < exact <= gamma
    assert peak(response(A, B, C, np.geomspace(1e-3, 1e3, 4000))) == pytest.approx(exact, rel=2e-3)


def test_what_cannot_be_controlled_is_said():
    """An unstable state that no input reaches."""
    p = scalar_problem(1.0)._replace(B2=np.zeros((1, 1)))
    with pytest.raises(InputError, match="no controller"):
        synthesise(p)


@pytest.mark.parametrize("order", [2, 4])
def test_truncation_keeps_to_its_bound(order):
    """Twice the sum of the Hankel values left out (Glover 1984), in the units of the scale."""
    rng = np.random.default_rng(5)
    A = rng.standard_normal((6, 6)) - 5.0 * np.eye(6)
    k = Controller(A, rng.standard_normal((6, 1)), rng.standard_normal((6, 2)), rng.standard_normal((1, 6)))
    scale = np.array([1.0, 0.01, 10.0])
    small, values = truncated(k, order, scale)
    assert len(small.A) == order
    both = np.block([[k.A, np.zeros((6, order))], [np.zeros((order, 6)), small.A]])
    inputs = np.vstack([np.hstack([c.B_u, c.B_y]) * scale for c in (k, small)])
    error = peak(response(both, inputs, np.hstack([k.C, -small.C]), np.geomspace(1e-2, 1e4, 4000)))
    assert 0.999 * values[order] <= error <= 2.0 * values[order:].sum()


def test_the_sampled_controller_is_the_continuous_one_at_low_frequency():
    """From y to u with u fed back into the observer form; at w the transform is exact at 2/T tan(w T / 2)."""
    p = random_problem(1)
    k, _ = synthesise(p)
    period, w = 1e-3, np.array([0.1, 1.0, 10.0, 300.0])
    step, output = bilinear(k, period)
    n = len(k.A)
    own = step[:, :n] + np.outer(step[:, n], output[:n])
    enter = step[:, n + 1 :] + np.outer(step[:, n], output[n + 1 :])
    z = np.exp(1j * w * period)
    sampled = np.array([output[:n] @ np.linalg.solve(x * np.eye(n) - own, enter) + output[n + 1 :] for x in z])
    warped = 2.0 / period * np.tan(0.5 * w * period)
    exact = response(k.A + k.B_u @ k.C, k.B_y, k.C, warped)[:, 0]
    np.testing.assert_allclose(sampled, exact, rtol=1e-7)
    low = response(k.A + k.B_u @ k.C, k.B_y, k.C, w[:3])[:, 0]
    np.testing.assert_allclose(sampled[:3], low, rtol=1e-3)
