"""Walking robots as Gymnasium environments, and a policy as a motion."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from workbench.files import InputError
from workbench.gait.drive.family import STRAIGHT, GaitFamily, Steer, load_family
from workbench.gait.drive.walk import SimulatedWalk
from workbench.gait.ensemble import Ensemble
from workbench.gait.learning.actions import Actions, CycleActions, PoseActions
from workbench.gait.learning.episode import Domains, Episode
from workbench.gait.learning.motion import learned_shape
from workbench.gait.learning.options import LearningOptions
from workbench.gait.table import gait_table
from workbench.robot import EffectSpec, puppy_model

gymnasium = pytest.importorskip("gymnasium", reason="needs gymnasium (the extra [learn])")

GAIT = Path(__file__).parents[2] / "data/gaits/demo/gait.csv"
SHORT = LearningOptions(cycles=2)
KINDS = ("cycle", "pose")


@pytest.fixture(scope="module")
def family() -> GaitFamily:
    return load_family(GAIT, puppy_model())


def actions_of(kind: str, family: GaitFamily, options: LearningOptions = SHORT) -> Actions:
    return CycleActions(family, options) if kind == "cycle" else PoseActions(family, options)


@pytest.mark.parametrize("kind", KINDS)
def test_gymnasiums_own_check_finds_nothing(kind: str, family: GaitFamily) -> None:
    """It runs episodes, compares seeds and spaces, and warns, which is an error here."""
    from gymnasium.utils.env_checker import check_env

    from workbench.gait.learning.environment import GaitEnv

    check_env(GaitEnv(family, [puppy_model()], kind, SHORT), skip_render_check=True)  # type: ignore[arg-type]


def test_no_action_is_the_gait_itself(family: GaitFamily) -> None:
    """Pose by pose: the goals of its table; its speeds, which come from goals that are rounded already, to one count of a goal in
    a dwell."""
    actions, table = PoseActions(family, SHORT), gait_table(family.machine, family.shape)
    still, gait = np.zeros(actions.size), table.cycle.commands(1)
    for k in range(family.shape.poses):
        played = actions.commands(k, still, still)
        np.testing.assert_allclose(played.goals[0], gait.goals[k], atol=1e-12)
        rounded = family.machine.units[0].count / played.end + family.machine.speed_unit[0]
        assert np.abs(played.speeds[0] - gait.speeds[k]).max() <= rounded
        assert played.end == pytest.approx(table.cycle.dwells_ms[k] / 1000)


def test_an_episode_of_turns_is_the_walk_that_drive_plays(family: GaitFamily) -> None:
    """Same turns, same step: the same place to a millimetre."""
    options = LearningOptions(cycles=3, time_step=1e-3)
    episode = Episode(Domains(CycleActions(family, options), [puppy_model()], options), 0)
    walk = SimulatedWalk(family, puppy_model())
    walk.begin()
    for turn in (0.05, 0.1, 0.0):
        episode.step(np.array([turn / options.turn, 0.0]))
        pose = walk.cycle(Steer(turn), STRAIGHT).pose
    assert episode.over
    np.testing.assert_allclose(episode.take().p_WB[-1, :2], pose[:2], atol=1e-3)


def test_turn_and_pace_do_what_they_say(family: GaitFamily) -> None:
    options = LearningOptions(cycles=4)
    domains = Domains(CycleActions(family, options), [puppy_model()], options)
    ends = {}
    for name, action in {"slow": (0.0, -1.0), "straight": (0.0, 0.0), "left": (1.0, 0.0)}.items():
        episode = Episode(domains, 0)
        rewards = [episode.step(np.array(action)) for _ in range(4)]
        ends[name] = episode.seen, sum(rewards)
    assert ends["slow"][1] < 0.75 * ends["straight"][1]
    assert ends["left"][0][4] > ends["straight"][0][4] + 0.4, "heading, in units of 0.5 rad"


@pytest.mark.parametrize("kind", KINDS)
def test_robots_side_by_side_walk_as_one_by_one_and_begin_again(kind: str, family: GaitFamily) -> None:
    """Two robots of different friction; the episode's last step is followed by one that begins the next."""
    from workbench.gait.learning.environment import GaitVectorEnv

    robots = [puppy_model(), puppy_model().with_effect(EffectSpec("ground_friction", (), {"friction": 0.3}))]
    env = GaitVectorEnv(3, family, robots, kind, SHORT)  # type: ignore[arg-type]
    seen, _ = env.reset(seed=5)
    assert env.observation_space.contains(seen)
    steps = SHORT.cycles * actions_of(kind, family).in_cycle
    rng = np.random.default_rng(1)
    played = [rng.uniform(-0.5, 0.5, env.action_space.shape).astype(np.float32) for _ in range(steps)]
    rewards = []
    for actions in played:
        seen, reward, fell, over, _ = env.step(actions)
        rewards.append(reward)
    assert over.all()
    assert not fell.any()
    domains = Domains(actions_of(kind, family), robots, SHORT)
    for k in range(3):
        alone = []
        for robot in (0, 1):
            episode = Episode(domains, robot)
            alone.append([episode.step(actions[k]) for actions in played])
        assert np.isclose(alone, np.array(rewards)[:, k], atol=1e-9).all(axis=1).any()
    _, reward, fell, over, _ = env.step(played[0])
    assert not over.any()
    assert (reward == 0).all()
    env.close()


def test_a_fall_ends_the_episode_and_costs(family: GaitFamily) -> None:
    from workbench.gait.learning.environment import GaitEnv

    env = GaitEnv(family, [puppy_model()], "pose", LearningOptions(cycles=12, offset=1.0))
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(12 * family.shape.poses):
        _, reward, fell, over, _ = env.step(rng.choice([-1.0, 1.0], env.action_space.shape).astype(np.float32))
        if fell or over:
            break
    assert fell
    assert not over
    assert reward < -20


def test_a_policy_becomes_the_gait_of_its_mean_cycle(family: GaitFamily) -> None:
    options = LearningOptions(cycles=6)
    turning = Domains(CycleActions(family, options), [puppy_model()], options)
    shape = learned_shape(lambda seen: np.array([0.2, -1.0]), turning)
    assert shape.turn == pytest.approx(family.shape.turn + 0.03)
    assert shape.stride == pytest.approx(0.5 * family.shape.stride)
    posing = Domains(PoseActions(family, options), [puppy_model()], options)
    up = np.linspace(-0.2, 0.2, posing.actions.size)
    posed = learned_shape(lambda seen: up * seen[0], posing)
    phases = 2 * np.pi * np.arange(family.shape.poses) / family.shape.poses
    columns = PoseActions(family, options).columns
    before = np.array(family.shape.offsets)[:, columns] if family.shape.offsets else 0.0
    expected = options.offset * np.outer(np.sin(phases), up)
    asked, (lower, upper) = gait_table(family.machine, posed).asked[:, columns], family.machine.bounds
    itself = gait_table(family.machine, family.shape).asked[:, columns]
    assert (asked >= np.minimum(lower[columns], itself) - 1e-9).all()
    assert (asked <= np.maximum(upper[columns], itself) + 1e-9).all()
    free = np.abs(expected).max(axis=0) < np.minimum(asked - lower[columns], upper[columns] - asked).min(axis=0)
    assert free.sum() >= 6, "some knees are at the end of their range already"
    np.testing.assert_allclose((np.array(posed.offsets)[:, columns] - before)[:, free], expected[:, free], atol=1e-6)


def test_robots_are_drawn_from_an_ensemble_and_can_be_chosen(family: GaitFamily, tmp_path: Path) -> None:
    from workbench.gait.learning.environment import GaitEnv, domains_of

    robots = domains_of(puppy_model(), Ensemble(ranges={"friction": (0.3, 0.9)}), 2, 0, tmp_path)
    assert len({r.sha256 for r in robots}) == 3
    env = GaitEnv(family, robots, "cycle", SHORT)
    assert env.reset(options={"robot": 2})[1] == {"robot": 2}
    assert {env.reset(seed=k)[1]["robot"] for k in range(20)} == {0, 1, 2}


def test_without_gymnasium_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    monkeypatch.delitem(sys.modules, "workbench.gait.learning.environment", raising=False)
    with pytest.raises(InputError, match=r"drake-workbench\[learn\]"):
        importlib.import_module("workbench.gait.learning.environment")
