"""H-infinity synthesis, balanced truncation, bilinear transform and norms of matrices, as numpy arrays.

The central controller comes from two Riccati equations (Doyle, Glover, Khargonekar, Francis, IEEE TAC
34(8), 1989; cross terms after Zhou, Doyle, Glover, Robust and Optimal Control, 1996, ch. 16), which
scipy solves. Of the solvers that would take the whole problem, SLICOT's is bound by slycot, which is
GPL-2.0 and has no wheel for some platforms that the rest of this package installs on; linear matrix
inequalities (cvxpy with Clarabel) lose digits where the optimum lets matrices become singular, which
is here always, and need four packages more.

A controller is kept in its observer form

    x' = A x + B_u u + B_y y,    u = C x

with the u that was really applied: with u = C x it is the central controller, and where a motor's
limit cuts u its states go on as the plant does, which is the anti-windup. A is stable in all that is
accepted here, so that this form can be truncated although the controller itself may be unstable.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, matrix_balance, solve_continuous_are, solve_continuous_lyapunov

from steer_env.errors import InputError

Matrix = NDArray[np.float64]
Complexes = NDArray[np.complex128]
HIGHEST = 1e4  # gamma beyond which nothing useful is left
CLOSE = 1.01  # gamma is found within this factor
RESIDUAL = 1e-6  # of a Riccati equation, over its largest term: more is no solution
BACKED_OFF = 1.05  # the central controller at the least gamma has infinite gains; this much above it does not


class Problem(NamedTuple):
    """x' = A x + B1 w + B2 u, z = C1 x + D12 u, y = C2 x + D21 w, with one u."""

    A: Matrix
    B1: Matrix
    B2: Matrix
    C1: Matrix
    C2: Matrix
    D12: Matrix
    D21: Matrix


class Controller(NamedTuple):
    """Observer form, see above: A [n, n], B_u [n, 1], B_y [n, n_y], C [1, n]."""

    A: Matrix
    B_u: Matrix
    B_y: Matrix
    C: Matrix


def synthesise(p: Problem) -> tuple[Controller, float]:
    """(Central controller, its gamma), gamma being 5 % above the least one.

    Raises InputError where no controller keeps gamma below 1e4.
    """
    T = _balance(p)
    p = p._replace(A=p.A * T / T[:, None], B1=p.B1 / T[:, None], B2=p.B2 / T[:, None], C1=p.C1 * T, C2=p.C2 * T)
    size = float(np.linalg.norm(p.D12))
    noise = np.linalg.inv(np.linalg.cholesky(p.D21 @ p.D21.T))
    q = p._replace(B2=p.B2 / size, D12=p.D12 / size, C2=noise @ p.C2, D21=noise @ p.D21)
    low, high = 1e-3, HIGHEST
    while high > CLOSE * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if _solutions(q, middle) else (middle, high)
    gamma = BACKED_OFF * high
    found = _solutions(q, gamma)
    if found is None:
        raise InputError("h_infinity", "no controller meets the weights", "ask for less: a lower bandwidth, say")
    X, Y = found
    worst = q.B1.T @ X / gamma**2
    F = -(q.B2.T @ X + q.D12.T @ q.C1)
    L = -(Y @ q.C2.T + q.B1 @ q.D21.T)
    G: Matrix = np.linalg.solve(Y @ X / gamma**2 - np.eye(len(q.A)), L).astype(np.float64)
    A = q.A + q.B1 @ worst - G @ (q.C2 + q.D21 @ worst)
    if np.linalg.eigvals(A).real.max() >= 0.0:
        raise InputError("h_infinity", "the controller's observer is unstable", "ask for less: a lower bandwidth, say")
    B_y: Matrix = (G @ noise).astype(np.float64)
    return Controller(A, p.B2, B_y, F / size), gamma


def _balance(p: Problem) -> Matrix:
    """Sizes of the states [n] in which the problem's matrices have even rows and columns."""
    n, B, C = len(p.A), np.hstack([p.B1, p.B2]), np.vstack([p.C1, p.C2])
    whole = np.block([[p.A, B, np.zeros((n, len(C)))], [np.zeros((B.shape[1], n + B.shape[1] + len(C)))],
                      [C, np.zeros((len(C), B.shape[1] + len(C)))]])  # fmt: skip
    sizes: Matrix = np.diag(matrix_balance(whole, permute=False)[1])[:n]
    return sizes


def _solutions(p: Problem, gamma: float) -> tuple[Matrix, Matrix] | None:
    """Stabilising solutions of both Riccati equations; None where gamma is too low for them."""
    n_w, n_z = p.B1.shape[1], p.C1.shape[0]
    try:
        X = _riccati(p.A, np.hstack([p.B1, p.B2]), p.C1, np.hstack([np.zeros((n_z, n_w)), p.D12]), gamma, n_w)
        Y = _riccati(p.A.T, np.vstack([p.C1, p.C2]).T, p.B1.T, np.hstack([np.zeros((n_w, n_z)), p.D21.T]), gamma, n_z)
    except np.linalg.LinAlgError:
        return None
    for S in (X, Y):
        values = np.linalg.eigvalsh(S)
        if values[0] < -1e-7 * values[-1]:
            return None
    return (X, Y) if np.abs(np.linalg.eigvals(X @ Y)).max() < gamma**2 else None


def _riccati(A: Matrix, B: Matrix, C: Matrix, D: Matrix, gamma: float, n: int) -> Matrix:
    """A'X + XA - (XB + C'D) R^-1 (B'X + D'C) + C'C = 0, R = diag(-gamma^2 (n times), 1, ...)."""
    R = block_diag(-(gamma**2) * np.eye(n), np.eye(B.shape[1] - n))
    X: Matrix = solve_continuous_are(A, B, C.T @ C, R, s=C.T @ D)
    gain = X @ B + C.T @ D
    rest = A.T @ X + X @ A - gain @ np.linalg.solve(R, gain.T) + C.T @ C
    if np.abs(rest).max() > RESIDUAL * np.abs(A.T @ X).max():
        raise np.linalg.LinAlgError("no solution")
    return X


def truncated(k: Controller, order: int, scale: Matrix) -> tuple[Controller, Matrix]:
    """(Controller of at most ``order`` states, Hankel singular values of its observer form).

    Balanced truncation of the map from (u, y) to u, in units of ``scale`` [1 + n_y] of them. In these
    units that map changes by no more than twice the sum of the values left out (H-infinity norm).
    """
    B, C = np.hstack([k.B_u, k.B_y]) * scale, k.C / scale[0]
    P, Q = _root(solve_continuous_lyapunov(k.A, -B @ B.T)), _root(solve_continuous_lyapunov(k.A.T, -C.T @ C))
    U, values, V = np.linalg.svd(Q.T @ P)
    n = min(order, int(np.sum(values > 1e-9 * values[0])))
    right, left = P @ V[:n].T / np.sqrt(values[:n]), Q @ U[:, :n] / np.sqrt(values[:n])
    B = left.T @ np.hstack([k.B_u, k.B_y])
    return Controller(left.T @ k.A @ right, B[:, :1], B[:, 1:], k.C @ right), values


def _root(M: Matrix) -> Matrix:
    values, vectors = np.linalg.eigh(0.5 * (M + M.T))
    root: Matrix = vectors * np.sqrt(np.maximum(values, 0.0))
    return root


def bilinear(k: Controller, period: float) -> tuple[Matrix, Matrix]:
    """(Step [n, n + 1 + n_y], output [n + 1 + n_y]) of the observer form at a period in s.

        x+ = step (x, u, y),    u = output (x, 0, y)

    The bilinear transform lets u feed through to itself; the output is solved for it.
    """
    n = len(k.A)
    M = np.linalg.inv(np.eye(n) - 0.5 * period * k.A)
    B = period * M @ np.hstack([k.B_u, k.B_y])
    C = k.C @ M
    D = 0.5 * C @ np.hstack([k.B_u, k.B_y]) * period
    output = np.hstack([C, D])[0] / (1.0 - D[0, 0])
    output[n] = 0.0
    return np.hstack([M @ (np.eye(n) + 0.5 * period * k.A), B]), output


def closed(p: Problem, k: Controller) -> tuple[Matrix, Matrix, Matrix]:
    """A, B, C of the loop from w to z (no direct term)."""
    A = np.block([[p.A, p.B2 @ k.C], [k.B_y @ p.C2, k.A + k.B_u @ k.C]])
    return A, np.vstack([p.B1, k.B_y @ p.D21]), np.hstack([p.C1, p.D12 @ k.C])


def response(A: Matrix, B: Matrix, C: Matrix, omega: Matrix) -> Complexes:
    """C (jw - A)^-1 B at omega [f] in rad/s, as [f, outputs, inputs]."""
    s = 1j * omega[:, None, None]
    inputs = np.broadcast_to(B, (omega.size, *B.shape))
    return np.asarray(C @ np.linalg.solve(s * np.eye(len(A)) - A, inputs), dtype=complex)


def peak(responses: Complexes) -> float:
    """Largest singular value over responses [f, outputs, inputs]."""
    return float(np.linalg.svd(responses, compute_uv=False).max())
