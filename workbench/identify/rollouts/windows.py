"""A log cut into windows, each of which starts from the state that was recorded there.

Over seconds an arm that sticks and slips diverges by chance: an open-loop rollout of a whole log jumps when a parameter changes a
little, and one missed slip affects everything after it. From recorded states, over less than a second, residuals depend nearly
linearly on the errors of the model (multiple shooting; H. G. Bock, Springer Ser. Chem. Phys. 18, 1981).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.cache import Cache
from workbench.compare.session_takes import RegisteredTake
from workbench.identify.options import PROBLEM
from workbench.simulation.steady import JointStates
from workbench.types import Array

_known: Cache[JointStates] = Cache(PROBLEM.states_kept)


def recorded_states(take: RegisteredTake, horizon: float) -> JointStates:
    """States of a servo log's joints every `horizon` [s] after its first command; the same object for the same take."""
    return _known.get((id(take), horizon), lambda: _read(take, horizon), held=take)


def _read(take: RegisteredTake, horizon: float) -> JointStates:
    since, recorded = take.recorded.since_start, take.recorded
    times = np.arange(horizon, float(since[-1]) - 0.1 * horizon, horizon)
    q, v = (np.full((len(times), len(take.model.joints)), np.nan) for _ in range(2))
    for joint in recorded.joints:
        column, values = take.model.joints.index(joint), recorded.q[:, recorded.column(joint)]
        seen = np.isfinite(values)
        q[:, column], v[:, column] = states_at(since[seen], values[seen], times)
    return JointStates(times, q, v)


@dataclass(frozen=True)
class _Polynomial:
    """A polynomial through the positions around one time: position [rad], speed [rad/s], its standard error for noise of 1 rad;
    squares: sum of squared residuals [rad^2]; freedom: their number less that of the coefficients."""

    position: float
    speed: float
    error: float
    squares: float
    freedom: int


def states_at(time: Array, position: Array, at: Array) -> tuple[Array, Array]:
    """Positions and speeds at these times, NaN where too little was seen.

    A sensor with a clock of its own makes a steadily moving joint seem to shake, and over a short span that becomes an error of
    the speed, which a freely swinging arm keeps for the whole window; over a long span a servo's acceleration changes. So the
    span is chosen for each time (O. Lepskii, Theory Probab. Appl. 35, 1991): the widest that agrees with every narrower one."""
    fits = [[_polynomial(time, position, t, span) for span in PROBLEM.state_spans] for t in at]
    first = [f[0] for f in fits if f[0] is not None and f[0].freedom > 0]
    freedom = sum(f.freedom for f in first)
    usual = sum(f.squares for f in first) / freedom if freedom else 0.0
    chosen = [_widest(each, usual) for each in fits]
    return (np.array([np.nan if f is None else f.position for f in chosen]),
            np.array([np.nan if f is None else f.speed for f in chosen]))


def _polynomial(time: Array, position: Array, at: float, span: float) -> _Polynomial | None:
    near = np.abs(time - at) <= span / 2 + 1e-9
    freedom = int(near.sum()) - PROBLEM.state_order - 1
    if freedom < 0:
        return None
    powers = np.vander(time[near] - at, PROBLEM.state_order + 1, increasing=True)
    fit = np.linalg.lstsq(powers, position[near], rcond=None)[0]
    error = float(np.linalg.norm(np.linalg.pinv(powers)[1]))
    return _Polynomial(float(fit[0]), float(fit[1]), error, float(np.sum(np.square(position[near] - powers @ fit))), freedom)


def _widest(fits: Sequence[_Polynomial | None], usual: float) -> _Polynomial | None:
    """The best of fits over growing spans. usual [rad^2]: variance of the noise in all windows together, which is least believed
    here."""
    chosen = fits[0]
    if chosen is None:
        return None
    noise = np.sqrt(max(usual, chosen.squares / chosen.freedom if chosen.freedom else 0.0))
    low, high = -np.inf, np.inf
    for f in fits:
        if f is None:
            break
        reach = PROBLEM.state_agree * f.error * noise
        low, high = max(low, f.speed - reach), min(high, f.speed + reach)
        if low > high:
            break
        chosen = f
    return chosen
