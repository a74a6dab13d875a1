"""Every k-th event of a playing fails, for every kind of fault; a monitor that shares no code with the player judges."""

from dataclasses import replace

import pytest

from tests.rude.host_campaign import EVERY, Run, campaign
from tests.rude.host_faults import FAULTS
from tests.rude.monitor import Allowed, Held, Monitor, Sample

FOUND = [
    ("XL-330", "short stall", 3, 26),
    ("XL-330", "lost command", 53, 702),
    ("XL-330", "lost command", 7, 241),
    ("XL-330", "garbled command", 7, 573),
    ("AX-12A", "short stall", 3, 93),
    ("STS3215", "long stall", 544, 255),
    ("STS3215", "second program", 450, 3),
    ("XL-330", "garbled command", 5, 198),
    ("AX-12A", "garbled command", 11, 791),
    ("AX-12A", "stall", 252, 940),
    ("AX-12A", "twin", 248, 726),
    ("STS3215", "twin", 358, 16),
    ("STS3215", "twin", 371, 17),
    ("AX-12A", "brown-out", 117, 817),
    ("AX-12A", "stall", 185, 226),
    ("AX-12A", "twin", 255, 176),
    ("AX-12A", "brown-out", 300, 3),
    ("XL-330", "garbled command", 7, 3),
    ("XL-330", "garbled command", 11, 760),
    ("STS3215", "restart", 615, 6),
    ("AX-12A", "twin", 180, 217),
    ("AX-12A", "twin", 260, 219),
    ("STS3215", "twin", 338, 651),
    ("STS3215", "twin", 218, 685),
    ("AX-12A", "cable", 120, 196),
    ("AX-12A", "deaf port", 173, 474),
    ("XL-330", "brown-out", 285, 174),
    ("XL-330", "twin", 271, 883),
]
"""Violations that the campaign found, by family, fault, k and seed: late answers in the log as if they were new; poses that got
lost on the wire, or were sent in a bunch after a stall, one 0.5 ms before the next, and exit code 0; answers to another
program's questions in the log; torque that stayed on where a start failed; two servos of one ID that were taken for one as
long as an answer could be read now and then, and whose positions were mixed in the log; servos that restarted and got torque,
at full force, from the next pose; a stall in the first pose, after which all others came too early; torque limits and speeds that
did not arrive before torque came on; a servo of two with one ID that still answered when the next was asked, so that that one
held its goal in the ramp to neutral; positions in the log of a servo that nobody heard any more. The last three were the
campaign's own: it took the first goal in the log for the first pose, which had been withheld."""


@pytest.mark.parametrize("found", FOUND, ids=["-".join(map(str, f)) for f in FOUND])
def test_what_the_campaign_once_found(found):
    assert Run(*found).play() == []


@pytest.mark.parametrize("seed", range(3))
def test_no_fault_makes_the_player_do_harm_or_lie(seed):
    """600 faults in all."""
    struck, violated = campaign(200, seed)
    assert struck >= 200
    assert [f"{run.family}, {run.fault}, {run.k}, {run.seed}: {line}" for run, line in violated] == []


def test_faults_strike():
    """A campaign in which nothing happens proves nothing."""
    for fault in ("lost answer", "lost command", "short stall", "stray byte"):
        run = Run("AX-12A", fault, EVERY[2])
        run.play()
        assert len(run.struck) > 10, fault
    assert len(FAULTS) == len(set(FAULTS)) == 26


def test_the_monitor_sees_what_it_is_there_for():
    """Each invariant, broken on purpose; those of every robot are tested in test_controller_campaign.py."""
    allowed = Allowed(low=0, high=1023, neutral=512, fastest=100, ramp=50, half=512, near=10)

    def sample(time, angle=0.0, goal=0.0, **of):
        held = Held(torque=True, goal=512, speed=40, limit=512, answers=True, hears=True, hot=False, overloaded=False)
        return Sample(time, {1: replace(held, **of)}, {1: goal}, {1: angle})

    def broken(samples, stops=(), releases=(9.0,)):
        return Monitor(allowed, samples).broken(list(stops), list(releases))

    assert broken([sample(0.0), sample(0.1)]) == []
    assert "torque 50 ms after a release" in broken([sample(0.0), sample(0.1), sample(0.2)], releases=[0.05])[0]
    assert "without or beyond its speed" in broken([sample(0.0), sample(0.1, speed=0)])[0]
    walk = [sample(0.01 * k, answers=k < 20) for k in range(80)]
    away = [Sample(s.time, {1: replace(s.held[1], goal=512 + 20 * (k % 3), speed=90 if s.time else 40)}, s.goal, s.angle)
            for k, s in enumerate(walk)]
    assert "fault was not found in 0.4 s" in broken(away)[0]
    assert "motion 50 ms after a stop" in broken(away[:20], stops=[0.05])[0]
    limp = [sample(0.1, torque=False), sample(0.2, torque=False, angle=0.1)]
    assert "moves by 0.100 rad" in Monitor(allowed, limp).moves_after_release(0.0)[0]
    assert Monitor(allowed, [sample(0.0)]).torque_at_the_end() == ["servo 1 still has torque"]
    assert Monitor(allowed, [sample(0.0), sample(0.1)]).poses_missed([(0.0, 0.2, {1: 0.3})], 0.01)
    assert Monitor(allowed, [sample(0.0), sample(0.1)]).log_errors([(0.05, 1, 0.1)], 0.01)
