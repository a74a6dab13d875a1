"""Steering once a cycle: path, step-to-step map, the quadratic programme, and the loop closed on a robot that obeys the map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from workbench.files import InputError
from workbench.gait.drive.controller import CycleController, limit_steer
from workbench.gait.drive.family import STRAIGHT, Steer
from workbench.gait.drive.observer import ASIDE, BIAS, GAIN, P11, PLAYED, PLAYED_SIDE, first_state, update_state
from workbench.gait.drive.options import DriveOptions
from workbench.gait.drive.path import WayPath
from workbench.gait.drive.plan import Disc, corridor, plan
from workbench.gait.drive.step_map import StepMap, increments
from workbench.gait.drive.walk import Seen
from workbench.robot import puppy_model
from workbench.view.scene.drive import DriveScene

MAP = StepMap(bias=0.0, gain=1.0, memory=0.4, ahead=0.12, aside=0.0, aside_gain=0.03, scatter=(0.01, 0.001), most=0.15)
SIDEWAYS = replace(MAP, side_gain=1.5, side_turns=1.0)
PERIOD = 0.4


def test_a_path_passes_its_way_points_and_begins_ahead() -> None:
    path = WayPath([(1.0, 0.0), (2.0, 0.5), (2.0, 1.5)])
    assert path.heading(0.0) == pytest.approx(0.0, abs=1e-6)
    for point in path.points:
        assert np.hypot(*(path.p - point).T).min() < 0.004
    along, left = path.project(np.array([0.5, 0.03]), 0.5)
    assert along == pytest.approx(0.5, abs=0.05)
    assert left > 0.02


def test_a_straight_path_projects_exactly_and_goes_on_beyond_its_end() -> None:
    path = WayPath([(2.0, 0.0)])
    assert path.project(np.array([2.3, -0.1]), 2.0) == pytest.approx((2.3, -0.1))


@pytest.mark.parametrize("points", [[], [(1.0, 0.0), (1.0, 0.0)], [(float("nan"), 0.0)], [(2000.0, 0.0)]])
def test_impossible_way_points_are_refused(points: list[tuple[float, float]]) -> None:
    with pytest.raises(InputError, match="way-point"):
        WayPath(points)


def test_increments_are_in_the_frame_at_each_beginning() -> None:
    yaw = np.pi / 2
    poses = np.array([[0.0, 0.0, yaw], [-0.01, 0.1, yaw + 0.1], [-0.01, 0.1, yaw + 0.1 - 2 * np.pi]])
    assert increments(poses)[0] == pytest.approx([0.1, 0.01, 0.1])
    assert increments(poses)[1] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)


def test_without_binding_limits_the_plan_is_the_least_squares_solution() -> None:
    """The programme written out as one linear least-squares problem in turns and sideways strides, by the normal equations."""
    o, N, m = DriveOptions(most=10.0, most_change=10.0, most_side=10.0, most_side_change=10.0), 4, SIDEWAYS
    left, heading, before, bias = 0.05, 0.1, 0.02, 0.03
    targets = np.array([0.0, 0.05, 0.1, 0.1, 0.1])

    def rolled(w: np.ndarray) -> np.ndarray:
        y, e, last, last_side, rows = left, heading - targets[0], before, 0.001, []
        for u, v, bend in zip(w[:N], w[N:], np.diff(targets)):
            rows += [y / o.aside, e / o.turned, (u - last) / o.change, (v - last_side) / o.side_change]
            turned = m.bias + bias + m.gain * u + m.memory * last + m.side_turns * v - bend
            y, e = y + m.ahead * (e - bend / 2) + m.aside + m.aside_gain * u + m.side_gain * v, e + turned
            last, last_side = u, v
        return np.array([*rows, y / o.aside, e / o.turned])

    base = rolled(np.zeros(2 * N))
    J = np.column_stack([rolled(np.eye(2 * N)[j]) - base for j in range(2 * N)])
    best = -np.linalg.solve(J.T @ J, J.T @ base)
    planned = plan(left, heading, Steer(before, 0.001), bias, targets, m, o)
    assert planned.turns == pytest.approx(best[:N], abs=1e-5)
    assert planned.sides == pytest.approx(best[N:], abs=1e-6)


def test_the_plan_keeps_its_limits_where_they_bind() -> None:
    o = DriveOptions()
    planned = plan(0.5, 1.0, STRAIGHT, 0.1, np.zeros(o.horizon + 1), SIDEWAYS, o)
    u, v = planned.turns, planned.sides
    assert np.abs(v).max() <= o.most_side + 1e-7
    assert np.diff(v, prepend=0.0)[0] == pytest.approx(-o.most_side_change, abs=1e-6)
    assert np.abs(u).max() <= o.most + 1e-6
    assert np.abs(np.diff(np.concatenate([[0.0], u]))).max() <= o.most_change + 1e-6
    assert u[0] == pytest.approx(-o.most_change, abs=1e-5)
    assert limit_steer(Steer(-1.0, -1.0), Steer(0.1, 0.002), o) == Steer(0.1 - o.most_change, 0.002 - o.most_side_change)


def test_a_disc_is_passed_on_its_free_side_and_a_robot_inside_one_gets_out() -> None:
    o, path = DriveOptions(), WayPath([(3.0, 0.0)])
    along = MAP.ahead * np.arange(o.horizon + 1)
    low, high = corridor(path, along, 0.0, [Disc(0.8, -0.05, 0.08)], o.clearance)
    assert np.isinf(high).all()
    assert low.max() == pytest.approx(0.15, abs=0.01)
    planned = plan(0.0, 0.0, STRAIGHT, 0.0, np.zeros(o.horizon + 1), MAP, o, (low, high))
    assert (planned.left - low).min() > -0.005
    inside = plan(0.0, 0.0, STRAIGHT, 0.0, np.zeros(o.horizon + 1), MAP, o, (np.full(o.horizon + 1, 0.1), high))
    assert inside.turns[0] == pytest.approx(o.most_change, abs=1e-4)
    assert inside.left[-1] > 0.09


def test_the_controller_walks_around_a_disc_and_comes_back() -> None:
    disc = Disc(1.5, 0.02, 0.1)
    poses = _drive(DriveOptions(), 0.02, 0.0, discs=[disc])
    assert np.hypot(poses[:, 0] - disc.x, poses[:, 1] - disc.y).min() > disc.radius + DriveOptions().clearance - 0.03
    assert abs(poses[-1, 1]) < 0.03


@pytest.mark.parametrize("law", ["mpc", "proportional"])
@pytest.mark.parametrize("bias", [np.radians(3.0), np.radians(-4.0)])
def test_a_robot_that_turns_by_itself_is_brought_onto_the_line(law: str, bias: float) -> None:
    """Without steering it would turn by 3 or 4 deg a cycle. One pose in ten is lost."""
    driven = _drive(DriveOptions(law=law), bias, lost=0.1)  # type: ignore[arg-type]
    assert abs(driven[-1, 1]) < 0.03
    assert abs(driven[-1, 2]) < np.radians(4.0)


@pytest.mark.parametrize("law", ["mpc", "proportional"])
def test_a_robot_that_walks_aside_keeps_the_line_and_its_heading(law: str) -> None:
    """By a sideways stride against it, where the gait has one; else its heading is off by as much as it walks aside."""
    aside = 0.008
    turned_only, sideways = (_drive(DriveOptions(law=law), 0.02, lost=0.1, aside=aside, m=m)  # type: ignore[arg-type]
                             for m in (MAP, SIDEWAYS))
    assert np.abs(sideways[20:, 1]).max() < 0.03
    assert np.mean(turned_only[20:, 2]) == pytest.approx(-aside / MAP.ahead, abs=0.015)
    assert abs(np.mean(sideways[20:, 2])) < 0.015


def test_the_observer_takes_no_sideways_stride_for_the_robots_own() -> None:
    x, y = first_state(SIDEWAYS, DriveOptions()), 0.0
    for _ in range(40):
        x[PLAYED_SIDE] = 0.004
        y += SIDEWAYS.side_gain * 0.004 - 0.002
        x = update_state(x, np.array([0.0, y, 0.0]), 0.0, replace(SIDEWAYS, side_turns=0.0), DriveOptions())
    assert x[ASIDE] == pytest.approx(-0.002, abs=1e-4)


def test_the_observer_finds_the_bias_and_its_own_doubt() -> None:
    o = DriveOptions(drift=1e-6)
    x = first_state(MAP, o)
    heading = 0.0
    for _ in range(40):
        heading += 0.03
        x = update_state(x, np.array([0.0, 0.0, heading]), 0.0, replace(MAP, scatter=(1e-4, 0.0)), o)
    assert x[BIAS] == pytest.approx(0.03, abs=1e-4)
    assert np.sqrt(x[P11]) < 1e-3


def test_the_observer_separates_gain_from_bias() -> None:
    """Of a robot that turns by a third more than the map says, and by 2 deg a cycle on its own."""
    o, rng = DriveOptions(drift=1e-6, first_gain=0.5), np.random.default_rng(0)
    x, heading, before = first_state(MAP, o), 0.0, 0.0
    for turn in rng.uniform(-0.15, 0.15, 60):
        heading += 0.035 + 4 / 3 * (MAP.gain * turn + MAP.memory * before)
        x[PLAYED] = turn
        x = update_state(x, np.array([0.0, 0.0, heading]), before, replace(MAP, scatter=(1e-3, 0.0)), o)
        before = turn
    assert x[GAIN] == pytest.approx(1 / 3, abs=0.02)
    assert x[BIAS] == pytest.approx(0.035, abs=0.002)


def test_on_an_arc_that_the_map_follows_exactly_there_is_nothing_to_correct() -> None:
    """A cycle that turns evenly moves aside by half of ahead times its turn, and so does the arc."""
    m, bend = replace(MAP, memory=0.0, gain=1.0, aside_gain=MAP.ahead / 2), 0.06
    o = DriveOptions()
    planned = plan(0.0, 0.0, Steer(bend), 0.0, bend * np.arange(o.horizon + 1), m, o)
    assert planned.turns == pytest.approx(np.full(o.horizon, bend), abs=1e-6)
    assert planned.left == pytest.approx(np.zeros(o.horizon + 1), abs=1e-7)


def test_a_path_begins_straight_and_bends_without_kinks() -> None:
    path = WayPath([(0.6, 0.15), (1.2, -0.15), (1.7, 0.1)])
    bend = np.gradient([path.heading(s) for s in path.s], path.s)
    assert abs(bend[1]) < 0.2
    assert np.abs(np.diff(bend)).max() < 0.2


def test_a_robot_that_the_cameras_lost_is_stopped() -> None:
    controller = CycleController(WayPath([(3.0, 0.0)]), MAP, PERIOD, DriveOptions(blind=3 * PERIOD))
    context = controller.CreateDefaultContext()
    stops = []
    for _ in range(4):
        controller.GetInputPort("pose").FixValue(context, np.full(3, np.nan))
        context.SetDiscreteState(0, controller.EvalUniquePeriodicDiscreteUpdate(context).value(0))
        stops.append(controller.GetOutputPort("stop").Eval(context)[0])
    assert stops == [0, 0, 1, 1]


def _drive(options: DriveOptions, bias: float, lost: float, cycles: int = 40, discs: Sequence[Disc] = (), aside: float = 0.0,
           m: StepMap = MAP) -> np.ndarray:
    """A robot that obeys the map, plus its own bias, way aside and the map's scatter. Poses (cycles, 3)."""
    rng = np.random.default_rng(3)
    controller = CycleController(WayPath([(10.0, 0.0)]), m, PERIOD, options, discs)
    context = controller.CreateDefaultContext()
    pose, played, committed, poses = np.zeros(3), STRAIGHT, STRAIGHT, []
    for _ in range(cycles):
        seen = np.full(3, np.nan) if rng.random() < lost else pose + rng.normal(size=3) * [1e-4, 1e-4, 0.002]
        controller.GetInputPort("pose").FixValue(context, seen)
        context.SetDiscreteState(0, controller.EvalUniquePeriodicDiscreteUpdate(context).value(0))
        after = Steer(*(float(controller.GetOutputPort(name).Eval(context)[0]) for name in ("turn", "side")))
        turned = m.turned(committed, played.turn) + bias + rng.normal() * m.scatter[0]
        c, s, side = np.cos(pose[2]), np.sin(pose[2]), aside + m.moved_aside(committed)
        pose = pose + np.array([m.ahead * c - side * s, m.ahead * s + side * c, turned])
        played, committed = committed, after
        poses.append(pose)
    return np.array(poses)


def test_the_live_view_shows_path_discs_plan_and_robot() -> None:
    """In Meshcat's own scene tree; the robot is where the cameras last saw it."""
    scene = DriveScene(puppy_model(), WayPath([(1.0, 0.2)]), [Disc(0.5, 0.0, 0.05)])
    for pose in ([0.1, 0.02, 0.3], [0.2, 0.03, 0.2], [np.nan] * 3):
        scene.show(Seen(np.array(pose), np.array(pose)), np.array([[0.2, 0.03], [0.25, 0.04]]))
    for name in ("path", "plan", "way", "discs/1", "way-points/1"):
        assert scene.meshcat.HasPath(f"/drive/{name}")
    assert scene.url.startswith("http")
    assert scene.place[:2] == pytest.approx([0.2, 0.03])
