"""Everything that a rollout's channels depend on, as a name under which they are remembered.

The robot, its effects, the take (commands, frames, start, windows, how it is looked at), the configuration, engine and step, and
the code that rollouts run through, effects of other packages included; not the code of the search, so that a change of that finds
every rollout again.
"""

from __future__ import annotations

import hashlib
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import joblib
import numpy as np

from workbench.effects.registry import known_effects
from workbench.robot import RobotModel
from workbench.simulation import SimulationConfig

if TYPE_CHECKING:
    from workbench.identify.problem import TakeEvidence

_ROOMS = ("files", "robot", "motion", "servo", "recording", "effects", "simulation", "identify/rollouts")
_FILES = ("compare/channels.py", "compare/comparison.py", "compare/session_takes.py", "identify/problem.py")


@cache
def rollout_code() -> str:
    """Digest of everything between a model and the channels of its rollout: versions, and the content of the packages it goes
    through."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256(" ".join(version(name) for name in ("drake", "numba", "numpy", "scipy")).encode())
    for path in sorted([*(p for room in _ROOMS for p in (root / room).rglob("*.py")), *(root / name for name in _FILES)]):
        digest.update(path.read_bytes())
    for path in _code_of_plug_ins():
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _code_of_plug_ins() -> list[Path]:
    """The modules that define effects of other packages, with the rest of their packages."""
    found: set[Path] = set()
    for effect in known_effects().values():
        module = sys.modules[type(effect).__module__]
        top = sys.modules[module.__name__.partition(".")[0]]
        if top.__name__ != "workbench":
            found.update(Path(file) for m in (module, top) if (file := getattr(m, "__file__", None)))
            found.update(path for folder in getattr(top, "__path__", ()) for path in Path(folder).rglob("*.py"))
    return sorted(found)


class ModelKeys:
    """Names of models, as `RobotModel.sha256` is, a hundred times cheaper: a robot's file is read once, as a search plays
    thousands of models that differ in numbers alone."""

    def __init__(self) -> None:
        self._files: dict[str, str] = {}
        self._last: tuple[RobotModel, str] | None = None

    def of(self, model: RobotModel) -> str:
        """Digest of the description's content and of everything stated about it."""
        if self._last is not None and self._last[0] is model:  # on another take
            return self._last[1]
        settings = repr((model.base, model.ground, model.rigid_bodies, model.bus_ids, model.feet))
        source = f"{model.description} {settings}"
        if source not in self._files:
            content = model.source.source.read_bytes()
            self._files[source] = hashlib.sha256(content + b" " + settings.encode()).hexdigest()
        physics = repr((sorted(model.servos.items()), model.effects))
        key = hashlib.sha256(f"{self._files[source]} {physics}".encode()).hexdigest()
        self._last = (model, key)
        return key


def take_key(e: TakeEvidence, config: SimulationConfig) -> str:
    """Digest of a take as it is simulated and observed, whatever the model."""
    played, spec = e.take.commands, e.take.spec
    sent = None if played is None else (played.joints, played.times, played.goals, played.speeds, played.enabled, played.end)
    windows = None if e.steadied is None else tuple(np.asarray(x) for x in vars(e.steadied).values())
    depends_on = (rollout_code(), repr(config), spec.base, spec.conditions, sent, e.take.start_state(), windows, e.since,
            e.take.recorded.time, e.channels, e.take.recorded.zeroed, vars(e.take.measurement))
    return str(joblib.hash(depends_on))
