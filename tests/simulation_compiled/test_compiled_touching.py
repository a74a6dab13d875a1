"""Spheres that touch boxes, cylinders and spheres of other links: steps and whole jobs by the compiled station and by Drake's."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RollPitchYaw

from tests.simulation_compiled.drake_steps import CompiledSteps, Step, config_for, drake_and_compiled
from workbench.motion.commands import Commands
from workbench.robot import Ground, RobotModel, ServoConstants, puppy_model
from workbench.simulation import Job, Simulation, Start
from workbench.simulation.batch import run_job
from workbench.simulation.compiled import CompiledJob, NotCoveredError
from workbench.simulation.rollout import BaseState

ROUNDING = 1e-9
"""Of velocities [rad/s, m/s] after one step."""
BALL, DEEP = 0.01, 4e-4
"""Radius of the sphere that touches, and how deep [m]."""
AT = np.array([0.05, 0.02, 0.3])
"""Centre of the touched shape, in W."""


def unit(*v: float) -> np.ndarray:
    return np.array(v) / np.linalg.norm(v)


@dataclass(frozen=True)
class Touch:
    """The touched shape, as SDF, and the sphere's centre in its frame."""

    solid: str
    middle: np.ndarray


BOX = "<box><size>0.06 0.04 0.05</size></box>"
CYLINDER = "<cylinder><radius>0.015</radius><length>0.05</length></cylinder>"
AWAY = BALL - DEEP
TOUCHES = {
    "a box's face": Touch(BOX, np.array([0.01, 0.02 + AWAY, -0.012])),
    "a box's edge": Touch(BOX, np.array([-0.03, 0.007, 0.025]) + AWAY * unit(-1, 0, 2)),
    "a box's corner": Touch(BOX, np.array([0.03, -0.02, -0.025]) + AWAY * unit(1, -2, -1.5)),
    "a cylinder's side": Touch(CYLINDER, np.array([*(0.015 + AWAY) * unit(2, -1), 0.014])),
    "a cylinder's end": Touch(CYLINDER, np.array([0.004, -0.009, -0.025 - AWAY])),
    "a cylinder's rim": Touch(CYLINDER, np.array([*0.015 * unit(-1, 3), 0.025]) + AWAY * unit(-1, 3, 2)),
    "a sphere": Touch("<sphere><radius>0.02</radius></sphere>", (0.02 + AWAY) * unit(1, 2, -1)),
}
PAIRS = {"two legs": ("l1", "r1"), "one leg": ("l0", "l2"), "a leg and the base": ("l1", "trunk"),
         "the base and a leg": ("trunk", "r1")}
"""The link that is touched, and that of the sphere."""


def materials(stiffness: float, dissipation: float, friction: float) -> str:
    return (f"<drake:proximity_properties><drake:point_contact_stiffness>{stiffness}</drake:point_contact_stiffness>"
            f"<drake:hunt_crossley_dissipation>{dissipation}</drake:hunt_crossley_dissipation><drake:mu_dynamic>{friction}"
            f"</drake:mu_dynamic><drake:mu_static>{friction}</drake:mu_static></drake:proximity_properties>")


def collision(name: str, at: np.ndarray, solid: str, material: str, turn: str = "0 0 0") -> str:
    return (f'<collision name="{name}"><pose>{row(at)} {turn}</pose><geometry>{solid}</geometry>{material}</collision>')


def row(values: np.ndarray) -> str:
    return " ".join(f"{v:.9f}" for v in values)


def two_legs(folder: Path, touch: Touch, on: tuple[str, str], feet: bool = False) -> RobotModel:
    """A trunk with two legs of three links, of which one's shape and another's sphere touch while all joints are at 0."""
    turn = np.array([0.4, -0.7, 1.1])
    R = RollPitchYaw(turn).ToRotationMatrix().matrix()
    where = {"trunk": np.array([0.0, 0.0, 0.3])}
    for leg, side in (("l", 0.06), ("r", -0.05)):
        for k in range(3):
            where[f"{leg}{k}"] = np.array([0.02 * k, side + 0.01 * k, 0.28 - 0.06 * k])
    shapes = dict.fromkeys(where, "")
    touched, ball = on
    shapes[touched] += collision("solid", AT - where[touched], touch.solid, materials(2e4, 30.0, 0.8), " ".join(map(str, turn)))
    shapes[ball] += collision("ball", AT + R @ touch.middle - where[ball], f"<sphere><radius>{BALL}</radius></sphere>",
                              materials(1e4, 10.0, 0.5))
    if feet:
        for k, (link, x) in enumerate((("l2", 0.05), ("r2", 0.04), ("trunk", -0.05))):
            foot = np.array([x, where[link][1], 0.01 - 1e-4])
            shapes[link] += collision(f"foot{k}", foot - where[link], "<sphere><radius>0.01</radius></sphere>",
                                      materials(1e5, 20.0, 0.6))
    inertia = "<inertia><ixx>3e-4</ixx><iyy>2e-4</iyy><izz>2.5e-4</izz></inertia>"
    links = [(f'<link name="{n}"><pose>{row(p)} 0 0 0</pose><inertial><mass>{0.8 if n == "trunk" else 0.1}</mass>{inertia}'
              f"</inertial>{shapes[n]}</link>") for n, p in where.items()]
    joints = [(f'<joint name="j_{leg}{k}" type="revolute"><parent>{"trunk" if k == 0 else f"{leg}{k - 1}"}</parent>'
               f'<child>{leg}{k}</child><axis><xyz>{"0 1 0" if k else "1 0 0"}</xyz></axis></joint>')
              for leg in "lr" for k in range(3)]
    path = folder / "legs.sdf"
    path.write_text('<?xml version="1.0"?><sdf version="1.9" xmlns:drake="http://drake.mit.edu"><model name="legs">'
                    f"{''.join(links + joints)}</model></sdf>")
    return RobotModel(str(path), base="trunk", servos={f"j_{leg}{k}": ServoConstants() for leg in "lr" for k in range(3)},
                      ground=Ground(stiffness=1e5, dissipation=20.0))


def one_step(model: RobotModel, base: str, random: np.random.Generator) -> Step:
    """Drake's step from a state in which joints are at 0 and all moves, or nearly nothing."""
    config = config_for(base)
    sim = Simulation(model, config)
    plant, context = sim.plant, sim._plant_context
    speed = random.choice([0.01, 0.3])
    v = random.uniform(-speed, speed, plant.num_velocities())
    q = np.zeros(len(model.joints))
    x = np.concatenate([[1.0, 0, 0, 0, 0, 0, 0.3] if base == "free" else [], q, v])
    goal = random.uniform(-0.2, 0.2, len(q))
    sim._command(goal, np.zeros(len(q)), np.ones(len(q)))
    plant.SetPositionsAndVelocities(context, x)
    sim.simulator.Initialize()
    plant.SetPositionsAndVelocities(context, x)
    reference = sim._bank()[1].get_discrete_state(0).CopyToVector()
    sim.simulator.AdvanceTo(config.time_step)
    after = plant.GetPositionsAndVelocities(context).copy()
    return Step(x, reference, reference, np.zeros(4 * len(q) + 1), goal, np.ones(len(q)), 0.0, after)


def check(model: RobotModel, base: str) -> None:
    """Steps agree, and the contact is in them: without it the station would end the run."""
    compiled, alone = (CompiledSteps(model, config_for(base), apart=a) for a in (False, True))
    for seed in range(4):
        step = one_step(model, base, np.random.default_rng(seed))
        assert np.abs(compiled.after(step) - step.after).max() < ROUNDING
        assert alone.after(step) is None


@pytest.mark.parametrize("base", ["fixed", "free"])
@pytest.mark.parametrize("name", TOUCHES)
def test_a_sphere_pushes_what_it_touches_on_another_leg(name, base, tmp_path):
    check(two_legs(tmp_path, TOUCHES[name], PAIRS["two legs"]), base)


@pytest.mark.parametrize("base", ["fixed", "free"])
@pytest.mark.parametrize("on", PAIRS)
@pytest.mark.parametrize("name", ["a box's edge", "a sphere"])
def test_wherever_in_the_tree_they_are(name, on, base, tmp_path):
    check(two_legs(tmp_path, TOUCHES[name], PAIRS[on]), base)


@pytest.mark.parametrize("on", PAIRS)
def test_feet_stand_on_the_floor_meanwhile(on, tmp_path):
    check(two_legs(tmp_path, TOUCHES["a cylinder's rim"], PAIRS[on], feet=True), "free")


@pytest.mark.parametrize("name", ["a box's face", "a cylinder's side", "a sphere"])
def test_a_sphere_whose_middle_is_inside_is_drakes(name, tmp_path):
    solid = TOUCHES[name].solid
    model = two_legs(tmp_path, Touch(solid, np.array([0.001, 0.002, 0.003])), PAIRS["two legs"])
    step = one_step(model, "fixed", np.random.default_rng(0))
    assert CompiledSteps(model, config_for("fixed")).after(step) is None


def test_boxes_that_touch_are_drakes(tmp_path):
    model = two_legs(tmp_path, TOUCHES["a box's face"], PAIRS["two legs"])
    ball, box = f"<sphere><radius>{BALL}</radius></sphere>", "<box><size>0.02 0.02 0.02</size></box>"
    model.path.write_text(model.path.read_text().replace(ball, box))
    step = one_step(model, "fixed", np.random.default_rng(0))
    assert CompiledSteps(model, config_for("fixed")).after(step) is None


POSE = {"tail": -15.6, "brb": 2.0, "brm": 0.7, "brt": -16.8, "frb": 23.8, "frm": -32.2, "frt": -25.6}
"""[deg]: a front foot presses on the thigh behind it."""


def pressing(base: str, **more) -> Job:
    """The puppy goes to that pose and back."""
    model = puppy_model(ground=Ground(friction=0.6, stiffness=1e5, dissipation=20.0))
    pose = np.deg2rad([POSE.get(j, 0.0) for j in model.joints])
    goals = np.array([pose, 0.0 * pose, pose])
    on = np.ones(goals.shape, dtype=bool)
    commands = Commands(np.array([0.0, 0.5, 0.7]), model.joints, goals, np.full(goals.shape, 3.0), on, 1.2, np.full(3, -1))
    return Job(model, config_for(base), commands, **more)


def both(job: Job):
    with pytest.raises(NotCoveredError, match="touch"):
        CompiledJob(job, apart=True).take()
    drake, compiled = drake_and_compiled(job)
    return run_job(drake), run_job(compiled)


def test_a_foot_that_presses_on_a_thigh_plays_the_same():
    drake, compiled = both(pressing("fixed", duration=1.2, lead=0.1, times=np.arange(0.0, 1.2, 0.01)))
    assert np.abs(drake.q - compiled.q).max() < np.deg2rad(1e-8)
    assert np.abs(drake.v - compiled.v).max() < 1e-7


def test_its_force_is_none_of_the_floors():
    job = pressing("free", duration=0.12)
    q = job.commands.goals[0]
    base = BaseState(*map(np.array, ([0.0, 0.0, 0.24], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])))
    job = replace(job, start=Start(q, 0.0 * q, base=base), config=replace(job.config, contact_period=1 / 120))
    drake, compiled = both(job)
    assert np.abs(drake.q - compiled.q).max() < np.deg2rad(1e-6)
    for foot, force in drake.contact.items():
        assert np.abs(force - compiled.contact[foot]).max() < 1e-4
    assert max(np.abs(f).max() for f in compiled.contact.values()) > 1.0
