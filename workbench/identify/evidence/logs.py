"""Residuals of servo logs of a held robot, straight from the compiled station where it covers them."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.identify.rollouts import Jury, Question
from workbench.robot import RobotModel
from workbench.simulation.compiled import NotCoveredError
from workbench.simulation.compiled.angles import servo_angles
from workbench.simulation.job import Job

Array = NDArray[np.float64]
SETTLE = 0.02
"""Rest of a robot whose log begins elsewhere [s]: it is put there."""


def residuals_of(jury: Jury, questions: Sequence[Question]) -> list[dict[int, Array]]:
    """As `Jury.residuals`; of logs without shifting their start, which is known."""
    if not questions or not all(_is_log(jury, i) for q in questions for i in q.takes):
        return jury.residuals(questions)
    held = replace(jury.config, base="fixed", settle=SETTLE)
    with ThreadPoolExecutor(jury.n_jobs) as pool:  # kernels hold no lock
        return list(pool.map(lambda q: _answer(jury, q, held), questions))


def _answer(jury: Jury, q: Question, held: object) -> dict[int, Array]:
    models: dict[str, RobotModel] = {}
    jobs = []
    for i in q.takes:
        spec = jury.evidence[i].take.spec
        key = repr(sorted(spec.servos.items()))
        models.setdefault(key, q.model.with_servos(spec.servos))
        jobs.append(_job(jury, i, models[key], held))
    try:
        angles = servo_angles(jobs)
    except NotCoveredError:
        return jury.residuals([q])[0]
    jury.rollouts += len(jobs)
    out = {}
    for i, q_servo in zip(q.takes, angles):
        e = jury.evidence[i]
        columns = [q.model.joints.index(j) for j in e.joints]
        simulated = np.full(e.recorded.shape, np.nan)
        simulated[(e.since >= 0) & (e.since <= e.until)] = q_servo[:, columns]
        out[i] = (e.recorded - simulated - e.offset) / (e.sigma * e.rough)
    return out


def _job(jury: Jury, i: int, model: RobotModel, held: object) -> Job:
    take = jury.evidence[i].take
    times = jury.evidence[i].since
    times = times[(times >= 0) & (times <= jury.evidence[i].until)]
    return Job(model, held, take.commands, float(times[-1]) + 2e-3, 0.1, name=take.spec.name,  # type: ignore[arg-type]
               times=times, start=take.start_state())


def _is_log(jury: Jury, i: int) -> bool:
    e = jury.evidence[i]
    return not e.take.recorded.zeroed and e.take.spec.base == "fixed" and e.channels == e.joints
