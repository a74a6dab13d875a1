"""A log cut into windows, each of which starts from the state that was recorded there.

Over seconds an arm that sticks and slips diverges by chance: an open-loop rollout of a whole log jumps when a parameter changes a
little, and one missed slip affects everything after it. From recorded states, over less than a second, residuals depend nearly
linearly on the errors of the model (multiple shooting; H. G. Bock, Springer Ser. Chem. Phys. 18, 1981).
"""

from __future__ import annotations

from collections import OrderedDict

import numpy as np

from workbench.compare.session_takes import RegisteredTake
from workbench.identify.options import PROBLEM
from workbench.simulation.steady import JointStates

_known: OrderedDict[tuple[int, float], tuple[RegisteredTake, JointStates]] = OrderedDict()


def recorded_states(take: RegisteredTake, horizon: float) -> JointStates:
    """Of a servo log's joints, every `horizon` [s] after its first command; the same object for the same take."""
    key = (id(take), horizon)
    if key not in _known:
        _known[key] = (take, _read(take, horizon))
        while len(_known) > PROBLEM.states_kept:
            _known.popitem(last=False)
    return _known[key][1]


def _read(take: RegisteredTake, horizon: float) -> JointStates:
    since, recorded = take.recorded.since_start, take.recorded
    times = np.arange(horizon, float(since[-1]) - 0.1 * horizon, horizon)
    q, v = (np.full((len(times), len(take.model.joints)), np.nan) for _ in range(2))
    for joint in recorded.joints:
        column, values = take.model.joints.index(joint), recorded.q[:, recorded.column(joint)]
        seen = np.isfinite(values)
        for k, t in enumerate(times):
            near = seen & (np.abs(since - t) <= PROBLEM.state_span / 2 + 1e-9)
            if near.sum() > PROBLEM.state_order:
                fit = np.polynomial.polynomial.polyfit(since[near] - t, values[near], PROBLEM.state_order)
                q[k, column], v[k, column] = fit[0], fit[1]
    return JointStates(times, q, v)
