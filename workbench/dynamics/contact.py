"""Contact forces inside the friction cone that explain a wrench best, for many samples at once."""

from __future__ import annotations

import numpy as np

from workbench.types import Array

STICKING = 0.02
"""Slip [m/s] around which friction changes from any direction to opposing the slip."""
AGAINST_SLIP = 100.0
"""Relative cost of force that does not oppose the slip: it is used only if the wrench requires it."""
_CHUNK = 4096
"""Samples that are solved at once: enough for numpy, few enough for the cache."""
_ITERATIONS, _HALVINGS = 60, 30
"""Limits of Newton's method and of its line search; it ends earlier, as soon as the gradient vanishes."""
_SOLVED = 1e-10
"""Gradient at which a sample is solved, as a share of 1 + its largest component."""


def share_forces(wrench: Array, arms: Array, slip: Array, friction: Array, cost: Array, scale: Array) -> tuple[Array, Array]:
    """Forces f (N, C, 3) [N] in W, each in its cone |f_xy| <= friction f_z, that minimise the residual of a wrench, and that
    residual, (N, 6).

    wrench: (N, 6) [moment N m, force N] about the point from which arms (N, C, 3) [m] lead to the contacts. slip: (N, C, 2)
    [m/s], velocity along the floor. friction: (C,). cost: (N, C) [1/N²] of force at each point; infinite: no contact there.
    scale: (6,), units in which the residual is weighed. NaN rows stay NaN.

    Minimises ½|r|² + ½ sum cost_c |f_c|² with r = (wrench - G f) / scale. Given r, each force is G_c' r / cost_c projected on
    its circular cone (no pyramid), so that one equation in the six unknowns r remains, r + G P(G' r / cost) = wrench / scale:
    the gradient of a strongly convex, piecewise smooth function. Newton's method with a line search finds its zero, for
    all samples at once (Qi and Sun, Math. Programming 58, 1993).

    Feet on the ground can push in many ways that have the same effect on the robot. Where a point slides, friction acts against
    the slip: each point has two cones, a cheap one that narrows to the ray against the slip as it gets faster, and the whole one,
    more expensive by AGAINST_SLIP, so that the residual is that of the whole cone.
    """
    N, C = arms.shape[:2]
    forces, residual = np.full((N, C, 3), np.nan), np.full((N, 6), np.nan)
    known = [np.isfinite(x.reshape(N, -1)).all(axis=1) for x in (wrench, arms, slip)]
    good = np.flatnonzero(np.all(known, axis=0))
    for start in range(0, len(good), _CHUNK):
        rows = good[start:start + _CHUNK]
        G = grasp(arms[rows]) / scale[:, None]  # (r, C, 6, 3)
        drag, rest = _drag(slip[rows], friction)
        G_drag = G.copy()
        G_drag[..., 2] += (G[..., :2] @ drag[..., None])[..., 0]
        ease = 1 / cost[rows]
        cones = np.concatenate([G_drag, G], axis=1), np.concatenate([rest, np.broadcast_to(friction, ease.shape)], axis=1)
        f, r = _solve(wrench[rows] / scale, *cones, np.concatenate([ease, ease / AGAINST_SLIP], axis=1))
        opposing, free = f[:, :C], f[:, C:]
        forces[rows], residual[rows] = opposing + free, r * scale
        forces[rows, :, :2] += drag * opposing[..., 2:]
    return forces, residual


def _drag(slip: Array, friction: Array) -> tuple[Array, Array]:
    """Friction of a sliding point per normal force (N, C, 2), and the coefficient (N, C) that is left for any direction: all of
    it where the point sticks, none where it surely slides."""
    speed = np.linalg.norm(slip, axis=2)
    size = np.hypot(speed, STICKING)
    return -(friction / size)[..., None] * slip, friction * (1 - speed / size)


def grasp(arms: Array) -> Array:
    """Grasp matrices (N, C, 6, 3), which turn a force at the end of each arm (N, C, 3) [m] into a wrench [moment, force]."""
    G = np.zeros((*arms.shape[:2], 6, 3))
    x, y, z = arms[..., 0], arms[..., 1], arms[..., 2]
    G[..., 0, 1], G[..., 0, 2], G[..., 1, 0], G[..., 1, 2], G[..., 2, 0], G[..., 2, 1] = -z, y, z, -x, -y, x
    G[..., 3:, :] = np.eye(3)
    return G


def _solve(w: Array, G: Array, mu: Array, ease: Array) -> tuple[Array, Array]:
    """Forces (N, K, 3) and residual (N, 6) for wrenches w (N, 6), grasp matrices G (N, K, 6, 3) and ease (N, K), 1 / cost."""
    flat = np.ascontiguousarray(G.transpose(0, 2, 1, 3)).reshape(len(G), 6, -1)
    r = np.zeros_like(w)
    f, value, gradient = _dual(r, w, flat, mu, ease)
    tolerance = _SOLVED * (1 + np.abs(w).max(axis=1))
    for _ in range(_ITERATIONS):
        rows = np.flatnonzero(np.abs(gradient).max(axis=1) > tolerance)
        if not len(rows):
            break
        D = _projection_slope(_pull(r[rows], flat[rows]), mu[rows]) * ease[rows][..., None, None]
        GD = (G[rows] @ D).transpose(0, 2, 1, 3).reshape(len(rows), 6, -1)
        step = -np.linalg.solve(np.eye(6) + GD @ flat[rows].transpose(0, 2, 1), gradient[rows][..., None])[..., 0]
        slope = np.sum(step * gradient[rows], axis=1)
        length = 1.0
        for _ in range(_HALVINGS):  # Armijo's rule; what satisfies it is done
            trial = r[rows] + length * step
            f_trial, v_trial, g_trial = _dual(trial, w[rows], flat[rows], mu[rows], ease[rows])
            good = v_trial <= value[rows] + 1e-4 * length * slope + 1e-14 * np.abs(value[rows])
            done = rows[good]
            r[done], f[done], value[done], gradient[done] = trial[good], f_trial[good], v_trial[good], g_trial[good]
            rows, step, slope = rows[~good], step[~good], slope[~good]
            if not len(rows):
                break
            length /= 2
    return f, w - (flat @ f.reshape(len(f), -1, 1))[..., 0]


def _pull(r: Array, flat: Array) -> Array:
    """G' r (N, K, 3)."""
    return np.asarray((r[:, None] @ flat).reshape(len(r), -1, 3))


def _dual(r: Array, w: Array, flat: Array, mu: Array, ease: Array) -> tuple[Array, Array, Array]:
    """Forces, value and gradient of ½|r|² + ½ sum ease |P(G'r)|² - w'r."""
    p = project(_pull(r, flat), mu)
    f = p * ease[..., None]
    value = np.sum(r * r, axis=1) / 2 + np.sum(p * f, axis=(1, 2)) / 2 - np.sum(w * r, axis=1)
    return f, value, r + (flat @ f.reshape(len(f), -1, 1))[..., 0] - w


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
