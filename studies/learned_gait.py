"""Can a learner improve a gait? Proximal policy optimisation on the goals of each pose, certified like any other motion.

    python -m studies.learned_gait [--out runs/studies/learned_gait] [--quick]

Needs the extra [learn] (Gymnasium, Stable-Baselines3). The demo's gait is the base: an action adds up to 0.1 rad to the goal of
each leg joint in each pose. Episodes are of the nominal robot and of robots drawn from the ensemble. The policy's mean cycle
becomes a gait (`learned_shape`), which is certified on fresh robots and compared with the demo's gait.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, replace
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from studies.common import ROOT, Array, publish, run_study, sign
from workbench.files import InputError
from workbench.gait.certificate import PUPPY_CLAIM
from workbench.gait.certify import Certified, CertifyOptions, certify
from workbench.gait.drive.family import GaitFamily, load_family
from workbench.gait.ensemble import load_ensemble
from workbench.gait.learning.motion import Policy, learned_shape, walk_episode
from workbench.gait.learning.options import LearningOptions
from workbench.gait.machine import GaitMachine
from workbench.gait.request import Request
from workbench.gait.shape import GaitShape
from workbench.gait.table import gait_table
from workbench.robot import RobotModel, puppy_model
from workbench.view.figures.style import in_house_style, new_figure
from workbench.view.report.page import Picture, Provenance, Report, Section, Table

GAIT = ROOT / "data/gaits/demo/gait.csv"
ACTIONS, QUICK_ACTIONS = 10_240, 512
DRAWN, SIDE_BY_SIDE, SEED = 6, 8, 58
ROLLOUT = 128
"""Actions of each robot between two updates of the policy, somewhat more than an episode: the gait has twelve poses."""
DELAYS = "command_delay"
"""Range that is left out of the robots that are learned on: fifteen servos with a delay each make an action five times slower."""
OPTIONS = LearningOptions(cycles=8, offset=0.1, lateral=0.5, heading=0.5, change=0.2)
TESTED = 4
"""Fresh robots on which policy and motion are compared."""


def taught(family: GaitFamily, robots: list[RobotModel], actions: int, options: LearningOptions,
           tell: Callable[[int], None]) -> tuple[Policy, list[float]]:
    """The policy after `actions` actions, and the mean reward of an episode over each tenth of them."""
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

    from workbench.gait.learning.environment import GaitEnv

    torch.set_num_threads(1)  # the network is small, and threads that wait for one another cost more than they save

    class Heard(BaseCallback):
        rewards: list[float]

        def _on_training_start(self) -> None:
            self.rewards = []

        def _on_step(self) -> bool:
            self.rewards += [float(i["episode"]["r"]) for i in self.locals["infos"] if "episode" in i]
            return True

        def _on_rollout_end(self) -> None:
            tell(self.num_timesteps)

    first = GaitEnv(family, robots, "pose", options)

    def another() -> GaitEnv:
        env = GaitEnv(family, robots[:1], "pose", options)
        env.domains = first.domains  # each robot's start is simulated once for all
        return env

    side_by_side = VecMonitor(DummyVecEnv([another] * SIDE_BY_SIDE))
    # small first actions: the gait that it begins with walks, and random poses fall
    learner = PPO("MlpPolicy", side_by_side, n_steps=ROLLOUT, batch_size=256, n_epochs=5, gamma=0.97, learning_rate=5e-4,
                  seed=SEED, device="cpu", policy_kwargs={"log_std_init": -1.5, "net_arch": [64, 64]})
    heard = Heard()
    learner.learn(actions, callback=heard)
    means = [float(np.mean(part)) for part in np.array_split(heard.rewards, 10) if len(part)]

    def policy(seen: Array) -> Array:
        return np.asarray(learner.predict(seen, deterministic=True)[0], dtype=float)

    return policy, means


def distances(policy: Policy, family: GaitFamily, robots: list[RobotModel], options: LearningOptions) -> list[float]:
    """How far each robot comes along x in an episode under the policy [m]; NaN where it falls."""
    from workbench.gait.learning.environment import GaitEnv

    domains = GaitEnv(family, robots, "pose", options).domains
    out = []
    for k in range(len(robots)):
        episode, _ = walk_episode(policy, domains, k)
        p = episode.take().p_WB
        assert p is not None
        out.append(float("nan") if episode.fell else float(p[-1, 0]))
    return out


def certified(machine: GaitMachine, shape: GaitShape, options: CertifyOptions, folder: Path, tell: Callable[[str], None]
              ) -> Certified:
    """The certificate of a shape on robots that were not trained on, the same ones for each shape."""
    fresh = load_ensemble().draws(machine.model, options.draws, SEED + 1, folder)
    return certify(machine, Request(), gait_table(machine, shape), fresh, options, lambda what, done: tell(what),
                   {"seed": SEED, "searched in": 0.0, "rollouts": 0})


@in_house_style
def learning_curve(means: list[float]) -> Figure:
    """Reward over a tenth of the training each."""
    figure = new_figure(5, 3)
    axes = figure.subplots()
    axes.plot(np.arange(1, len(means) + 1) / len(means), means, "o-")
    axes.set_xlabel("share of the training")
    axes.set_ylabel("mean reward of an episode [cm]")
    return figure


def study(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Teaches, compares, certifies."""
    if find_spec("gymnasium") is None or find_spec("stable_baselines3") is None:
        raise InputError(None, "this study needs Gymnasium and Stable-Baselines3: pip install 'drake-workbench[learn]'")
    model = puppy_model()
    family, actions = load_family(GAIT, model), QUICK_ACTIONS if quick else ACTIONS
    options = replace(OPTIONS, cycles=6) if quick else OPTIONS
    draws = CertifyOptions(draws=2 if quick else 20, checked=0, trimmed=0, watched=0, seconds=1.0 if quick else 2.0, variants=(),
                           n_jobs=1)  # enough for limits, speeds and falls; without numerical floor and return to the cycle
    began = time.process_time()
    with TemporaryDirectory(prefix="workbench-") as folder:
        everything = load_ensemble()
        ensemble = replace(everything, ranges={k: v for k, v in everything.ranges.items() if k != DELAYS})
        robots = [model, *ensemble.draws(model, 1 if quick else DRAWN, SEED, Path(folder))]
        policy, means = taught(family, robots, actions, options, lambda n: progress(f"{n} actions", n / actions))
        learned_in = time.process_time() - began
        shape = learned_shape(policy, _domains(family, robots[:1], options))
        fresh = [model, *load_ensemble().draws(model, 2 if quick else TESTED, SEED + 2, Path(folder))]
        gone = {"the gait itself": distances(lambda seen: np.zeros(len(seen) - 8 - len(model.joints)), family, fresh, options),
                "the policy": distances(policy, family, fresh, options)}
        results = {name: certified(family.machine, s, draws, Path(folder), lambda what: progress(what, None))
                   for name, s in (("the gait itself", family.shape), ("learned", shape))}
    rows = {name: _row(c) for name, c in results.items()}
    summary = (f"{actions} actions, {learned_in:.0f} s of processor. Policy on {len(fresh) - 1} fresh robots: "
               f"{_gained(gone):+.0f} % distance; its motion: {rows['learned']['nominal']:.3f} m/s for "
               f"{rows['the gait itself']['nominal']:.3f}, 5th percentile {_speed(rows['learned']['fifth'])} for "
               f"{_speed(rows['the gait itself']['fifth'])}, certificate {'kept' if rows['learned']['kept'] else 'refused'}")
    curve = learning_curve(means)
    report = Report("A learned gait", summary, f"{__doc__}\n\n{PUPPY_CLAIM}", [], Provenance.of(model))
    report.add(Section("Learning", [Picture(curve, f"{len(robots)} robots, {SIDE_BY_SIDE} episodes at a time.")]))
    report.add(Section("Fresh robots, one episode each", [Table(
        ["robot", *gone], [[str(k), *(sign(100 * v[k]) for v in gone.values())] for k in range(len(fresh))],
        "Distance along x [cm]; robot 0 is the nominal one. – : it fell.")]))
    report.add(Section("As motions", [Table(
        ["motion", "nominal [m/s]", "5th percentile [m/s]", "fell", "limits broken"],
        [[name, f"{r['nominal']:.3f}", _speed(r["fifth"]), f"{r['fell']} of {r['draws']}", "; ".join(r["broken"]) or "–"]
         for name, r in rows.items()])]))
    numbers = {"actions": actions, "processor s": learned_in, "rewards": means, "distances m": gone, "certificates": rows,
               "shape": asdict(shape)}
    return f"{summary}; {publish(out, model, report, numbers, {'learning': curve})}"


def _domains(family: GaitFamily, robots: list[RobotModel], options: LearningOptions) -> Any:
    from workbench.gait.learning.environment import GaitEnv

    return GaitEnv(family, robots, "pose", options).domains


def _row(c: Certified) -> dict[str, Any]:
    k = c.certificate
    broken = [str(m) for m in k.margins if m.use > 1 and not m.advice]
    return {"kept": k.kept, "nominal": k.nominal.speed, "draws": k.draws["count"], "fell": k.draws["falls"],
            "fifth": k.draws["speed m/s"][1], "broken": broken}


def _speed(value: float | None) -> str:
    """A quantile [m/s]; there is none of fewer than 20 draws."""
    return "–" if value is None else f"{value:.3f}"


def _gained(gone: dict[str, list[float]]) -> float:
    """Mean distance of the policy over that of the gait, on the drawn robots on which neither fell [%]."""
    pairs = np.array(list(gone.values()))[:, 1:]
    both = pairs[:, np.isfinite(pairs).all(axis=0)].mean(axis=1)
    return float(100 * (both[1] / both[0] - 1)) if len(both) else float("nan")


if __name__ == "__main__":
    raise SystemExit(run_study("learned_gait", __doc__, study))
