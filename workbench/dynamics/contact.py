"""Contact forces inside the friction cone that explain a wrench best, for many samples at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_CHUNK = 4096
_ITERATIONS = 60


def share_forces(wrench: Array, arms: Array, friction: Array, cost: Array, scale: Array) -> tuple[Array, Array]:
    """Forces f (N, C, 3) [N] in W, each in its cone |f_xy| <= friction f_z, that leave least of a wrench, and what
    they leave, (N, 6).

    wrench: (N, 6) [moment N m, force N] about the point from which arms (N, C, 3) [m] lead to the contacts. friction: (C,)
    or (N, C). cost: (N, C) [1/N²] of force at each point; infinite: no contact there. scale: (6,), units in which the
    residual is weighed. NaN rows stay NaN.

    Minimises ½|r|² + ½ sum cost_c |f_c|² with r = (wrench - G f) / scale. Given r, each force is G_c' r / cost_c projected on
    its circular cone (no pyramid), so that one equation in the six unknowns r remains, r + G P(G' r / cost) = wrench / scale:
    the gradient of a strongly convex, piecewise smooth function. Newton's method with a line search finds its zero, for
    all samples at once (Qi and Sun, Math. Programming 58, 1993).
    """
    N, C = arms.shape[:2]
    forces, residual = np.full((N, C, 3), np.nan), np.full((N, 6), np.nan)
    mu = np.broadcast_to(friction, (N, C))
    good = np.flatnonzero(np.isfinite(wrench).all(axis=1) & np.isfinite(arms).all(axis=(1, 2)))
    for start in range(0, len(good), _CHUNK):
        rows = good[start:start + _CHUNK]
        G = grasp(arms[rows]) / scale[:, None]  # (r, C, 6, 3)
        f, r = _solve(wrench[rows] / scale, G, mu[rows], 1 / cost[rows])
        forces[rows], residual[rows] = f, r * scale
    return forces, residual


def grasp(arms: Array) -> Array:
    """Grasp matrices (N, C, 6, 3): wrench [moment, force] of a force at the arm's end."""
    G = np.zeros((*arms.shape[:2], 6, 3))
    x, y, z = arms[..., 0], arms[..., 1], arms[..., 2]
    G[..., 0, 1], G[..., 0, 2], G[..., 1, 0], G[..., 1, 2], G[..., 2, 0], G[..., 2, 1] = -z, y, z, -x, -y, x
    G[..., 3:, :] = np.eye(3)
    return G


def _solve(w: Array, G: Array, mu: Array, ease: Array) -> tuple[Array, Array]:
    r = np.zeros_like(w)
    f, value, gradient = _dual(r, w, G, mu, ease)
    tolerance = 1e-10 * (1 + np.abs(w).max(axis=1))
    for _ in range(_ITERATIONS):
        open_ = np.flatnonzero(np.abs(gradient).max(axis=1) > tolerance)
        if not len(open_):
            break
        Go = G[open_]
        D = _projection_slope(_pull(r[open_], Go), mu[open_]) * ease[open_][..., None, None]
        H = np.eye(6) + np.einsum("ncij,ncjk,nclk->nil", Go, D, Go, optimize=True)
        step = -np.linalg.solve(H, gradient[open_][..., None])[..., 0]
        slope = np.sum(step * gradient[open_], axis=1)
        length = np.ones(len(open_))
        for _ in range(30):  # Armijo
            trial = r[open_] + length[:, None] * step
            ft, vt, gt = _dual(trial, w[open_], Go, mu[open_], ease[open_])
            short = vt > value[open_] + 1e-4 * length * slope + 1e-14 * np.abs(value[open_])
            if not short.any():
                break
            length[short] /= 2
        r[open_], f[open_], value[open_], gradient[open_] = trial, ft, vt, gt
    return f, w - np.einsum("ncij,ncj->ni", G, f)


def _pull(r: Array, G: Array) -> Array:
    return np.asarray(np.einsum("ncij,ni->ncj", G, r))


def _dual(r: Array, w: Array, G: Array, mu: Array, ease: Array) -> tuple[Array, Array, Array]:
    """Forces, value and gradient of ½|r|² + ½ sum ease |P(G'r)|² - w'r."""
    p = project(_pull(r, G), mu)
    f = p * ease[..., None]
    value = np.sum(r * r, axis=1) / 2 + np.sum(p * f, axis=(1, 2)) / 2 - np.sum(w * r, axis=1)
    return f, value, r + np.einsum("ncij,ncj->ni", G, f) - w


def project(z: Array, mu: Array) -> Array:
    """Nearest point (..., 3) of the cone |f_xy| <= mu f_z, f_z >= 0."""
    size = np.hypot(z[..., 0], z[..., 1])
    inside, away = size <= mu * z[..., 2], mu * size <= -z[..., 2]
    normal = (z[..., 2] + mu * size) / (1 + mu**2)
    turn = mu * normal / np.where(size > 0, size, 1)
    out = np.concatenate([z[..., :2] * turn[..., None], normal[..., None]], axis=-1)
    out = np.where(inside[..., None], z, out)
    return np.asarray(np.where((away & ~inside)[..., None], 0.0, out))


def _projection_slope(z: Array, mu: Array) -> Array:
    """A generalised Jacobian (..., 3, 3) of `project`; symmetric, positive semidefinite."""
    size = np.hypot(z[..., 0], z[..., 1])
    inside, away = size <= mu * z[..., 2], mu * size <= -z[..., 2]
    t = z[..., :2] / np.where(size > 0, size, 1)[..., None]
    normal = (z[..., 2] + mu * size) / (1 + mu**2)
    along = np.concatenate([mu[..., None] * t, np.ones_like(size)[..., None]], axis=-1) / np.sqrt(1 + mu**2)[..., None]
    J = along[..., :, None] * along[..., None, :]
    across = np.eye(2) - t[..., :, None] * t[..., None, :]
    J[..., :2, :2] += (mu * normal / np.where(size > 0, size, 1))[..., None, None] * across
    J = np.where(inside[..., None, None], np.eye(3), J)
    return np.asarray(np.where((away & ~inside)[..., None, None], 0.0, J))
