"""What the search by evidence names where there is nothing to name: recordings that differ from the model by noise alone, and
placebos, on which lies something smooth that is no physics. What they came to is in docs/validation.md."""

from dataclasses import replace

import numpy as np
import pytest

from tests.evidence.linear import FRAME
from tests.evidence.rig_logs import record, smooth
from tests.evidence.test_search import robot, searched
from workbench.identify.diagnosis import diagnose_session

pytestmark = pytest.mark.slow
BESIDE = {"quiet": 0.0, "placebo": 0.015}
"""RMS of what is no physics [rad]: what good models leave of a hobby servo."""
MANY, LOGS = 30, 2
"""Sessions of each kind: of a robot that is linear in all numbers, and of a rig's logs."""


@pytest.mark.parametrize("kind", BESIDE)
def test_a_linear_robot_with_nothing_to_name_gets_no_name(kind):
    likeliest = []
    for seed in range(MANY):
        rollouts = robot({}, seed=1000 + 10 * seed)
        on_top = BESIDE[kind] * smooth(np.random.default_rng(7000 + seed), len(rollouts.truth), FRAME)
        _, _, p = searched(replace(rollouts, truth=rollouts.truth + on_top))
        likeliest.append(max(p.named.values(), default=0.0))
    print(kind, "likeliest names:", np.round(sorted(likeliest)[-5:], 2))
    assert sum(x >= 0.5 for x in likeliest) <= 1
    assert max(likeliest) < 0.9


@pytest.mark.parametrize("kind", BESIDE)
def test_logs_with_nothing_to_name_get_no_confident_name(tmp_path, kind):
    told = []
    for seed in range(LOGS):
        (tmp_path / str(seed)).mkdir()
        session = record(tmp_path / str(seed), seed=100 + seed, beside=BESIDE[kind])
        told += [(seed, f.effect, round(f.confidence, 2)) for f in diagnose_session(session, n_jobs=2).diagnosis.findings]
    print(kind, told)
    assert not [f for f in told if f[2] >= 0.9]
