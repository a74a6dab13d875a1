"""Rollouts in windows are remembered by the recorded states in which these begin."""

from dataclasses import replace

import numpy as np

from tests.evidence.rig_logs import record
from workbench.compare.session_takes import read_takes
from workbench.identify.options import PROBLEM
from workbench.identify.preparation import prepare
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.simulation import SimulationConfig


def test_a_log_that_was_recorded_elsewhere_is_rolled_out_anew(tmp_path):
    """Two logs of the same commands and start, of which one ends otherwise, share whole rollouts but no windows."""
    session = record(tmp_path)
    config = SimulationConfig(settle=0.6, contact_period=0, time_step=PROBLEM.time_step)
    evidence = prepare(session, read_takes(session)[0][:1], config, 1, lambda *_: None).evidence
    (e,) = evidence
    late = e.take.recorded.since_start > 1.0
    q = e.take.recorded.q + np.where(late, 0.2, 0.0)[:, None]
    other = replace(e, take=replace(e.take, recorded=replace(e.take.recorded, q=q)), recorded=q)
    first = RolloutEvaluator([e], config, 1)
    second = RolloutEvaluator([other], config, 1, first.memory)
    for horizon, new in ((np.inf, 0), (0.5, 1)):
        questions = [RolloutRequest(session.model, (0,), horizon=horizon)]
        first.uncorrected(questions)
        before = second.memory.rollouts
        second.uncorrected(questions)
        assert second.memory.rollouts - before == new
