"""What a rollout's channels depend on, as a name under which they are remembered.

The robot, its effects, the take (commands, frames, start, windows, how it is looked at), the configuration, engine and step, and
the code that rollouts run through; not the code of the search, so that a change of that finds every rollout again.
"""

from __future__ import annotations

import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path

import joblib
import numpy as np

from workbench.identify.problem import TakeEvidence
from workbench.simulation import SimulationConfig

_ROOMS = ("robot", "motion", "servo", "recording", "effects", "simulation")
_FILES = ("compare/channels.py", "compare/comparison.py", "compare/session_takes.py", "identify/problem.py",
          "identify/rollouts.py", "identify/rollout_key.py")


@cache
def rollout_code() -> str:
    """Of everything between a model and the channels of its rollout: versions, and the content of the packages it goes
    through."""
    root = Path(__file__).parents[1]
    digest = hashlib.sha256(" ".join(version(name) for name in ("drake", "numba", "numpy", "scipy")).encode())
    for path in sorted([*(p for room in _ROOMS for p in (root / room).rglob("*.py")), *(root / name for name in _FILES)]):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def take_key(e: TakeEvidence, config: SimulationConfig) -> str:
    """Of a take as it is simulated and looked at, whatever the model."""
    played, spec = e.take.commands, e.take.spec
    sent = None if played is None else (played.joints, played.times, played.goals, played.speeds, played.enabled, played.end)
    windows = None if e.steadied is None else tuple(np.asarray(x) for x in vars(e.steadied).values())
    depends_on = (rollout_code(), repr(config), spec.base, dict(spec.servos), sent, e.take.start_state(), windows, e.since,
            e.take.recorded.time, e.channels, e.take.recorded.zeroed, vars(e.take.measurement))
    return str(joblib.hash(depends_on))
