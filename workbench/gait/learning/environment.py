"""Gymnasium environments: one walking robot, and many that walk at the same time."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from workbench.files import InputError
from workbench.gait.drive.family import GaitFamily
from workbench.gait.ensemble import Ensemble
from workbench.gait.learning.actions import Actions, CycleActions, PoseActions
from workbench.gait.learning.episode import MOST, Domains, Episode
from workbench.gait.learning.options import LearningOptions
from workbench.robot import RobotModel
from workbench.types import Array

try:
    import gymnasium
    from gymnasium.spaces import Box
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ModuleNotFoundError:
    raise InputError(None, "learning needs Gymnasium: pip install 'drake-workbench[learn]'") from None

Kind = Literal["cycle", "pose"]
"""An action sets turn and pace of a cycle, or offsets of the goals of a pose."""


def domains_of(model: RobotModel, ensemble: Ensemble, count: int, seed: int, folder: Path) -> list[RobotModel]:
    """The robot itself and `count` variants of it, drawn from the ensemble (and from the posterior of a diagnosed robot). Files
    of variants with other masses are written into `folder`, which must be kept."""
    return [model, *ensemble.draws(model, count, seed, folder)]


class GaitEnv(gymnasium.Env):
    """One robot that walks a gait, changed by each action.

    actions: "cycle" or "pose". robots: each episode picks one at random; `reset(options={"robot": k})` chooses. Both spaces are
    boxes: actions from -1 to 1 (0 is the gait itself), observations as in `Episode.seen`. A fall terminates an episode; it is
    truncated after `options.cycles` cycles. The reward is in `LearningOptions`.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(self, family: GaitFamily, robots: Sequence[RobotModel], actions: Kind = "cycle",
                 options: LearningOptions | None = None) -> None:
        self.options = options or LearningOptions()
        self.actions: Actions = (CycleActions if actions == "cycle" else PoseActions)(family, self.options)
        self.domains = Domains(self.actions, robots, self.options)
        self.action_space = Box(-1.0, 1.0, (self.actions.size,), np.float32)
        self.observation_space = Box(-MOST, MOST, (Episode.seen_by(self.actions),), np.float32)
        self.episode: Episode | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begins an episode. Its `info` says which robot walks."""
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(len(self.domains.robots)))
        which = int((options or {}).get("robot", drawn))
        self.episode = Episode(self.domains, which)
        return self.episode.seen, {"robot": which}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Plays one action."""
        assert self.episode is not None, "reset first"
        reward = self.episode.step(action)
        return self.episode.seen, reward, self.episode.fell, self.episode.over and not self.episode.fell, {}


class GaitVectorEnv(VectorEnv):
    """Many robots at once, each as in `GaitEnv`; the simulations run in threads. A robot whose episode has ended begins a new one
    with the next step, whose action is not played (`AutoresetMode.NEXT_STEP`)."""

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(self, num_envs: int, family: GaitFamily, robots: Sequence[RobotModel], actions: Kind = "cycle",
                 options: LearningOptions | None = None, threads: int = 2) -> None:
        self._one = GaitEnv(family, robots, actions, options)
        self.num_envs = num_envs
        self.single_action_space, self.single_observation_space = self._one.action_space, self._one.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._episodes: list[Episode] = []
        self._threads = ThreadPoolExecutor(threads)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begins an episode for each robot."""
        super().reset(seed=seed)
        self._episodes = [self._new() for _ in range(self.num_envs)]
        return self._seen(), {}

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Takes one action in each environment."""
        assert self._episodes, "reset first"
        ended = [e.fell or e.over for e in self._episodes]
        self._episodes = [self._new() if end else e for e, end in zip(self._episodes, ended)]
        walking = [k for k, end in enumerate(ended) if not end]
        rewards = np.zeros(self.num_envs)
        rewards[walking] = list(self._threads.map(lambda k: self._episodes[k].step(actions[k]), walking))
        fell = np.array([e.fell for e in self._episodes])
        over = np.array([e.over for e in self._episodes])
        return self._seen(), rewards, fell, over & ~fell, {}

    def close_extras(self, **kwargs: Any) -> None:
        """Ends the threads."""
        self._threads.shutdown()

    def _new(self) -> Episode:
        return Episode(self._one.domains, int(self.np_random.integers(len(self._one.domains.robots))))

    def _seen(self) -> Array:
        return np.stack([e.seen for e in self._episodes])
