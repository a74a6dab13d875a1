"""Heading by distance from a recording, and the turn that cancels it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.command import refused, succeeds
from workbench.api.robot_run import run_on_robot
from workbench.device.bus import Bus
from workbench.device.bus.survey import family_of
from workbench.files import InputError
from workbench.gait.evaluate import SEARCH, Evaluator
from workbench.gait.examine import CertifyOptions
from workbench.gait.machine import GaitMachine
from workbench.gait.optimize import OptimizeOptions
from workbench.gait.request import Request
from workbench.gait.requirements import drift
from workbench.gait.shape import GaitShape
from workbench.gait.straighten import (
    LEAST_GAIN_SPREAD,
    METRES,
    Straightener,
    TurnResponse,
    summary_of_straightened,
    turn_response,
    turned_by,
)
from workbench.gait.table import gait_table
from workbench.gait.trim import turn_in
from workbench.gait.turning import MOST_TRIM, TurnEstimate, recorded_turn
from workbench.motion import load_motion
from workbench.recording.body_track import BodyTrack
from workbench.recording.formats.motive_write import write_motive
from workbench.robot import EffectSpec, bus_ids, data_file, puppy_model
from workbench.simulation import Job
from workbench.simulation.compiled import CompiledJob
from workbench.simulation.virtual_robot import VirtualRobot

SHAPE = GaitShape("trot", (1, 1), 8, 2.2, stride=0.06, duty=0.6, lift=0.02, crouch=0.04, lead=1.0)
CROOKED = EffectSpec("zero_offset", ("flt",), {"angle": 5.0})


@pytest.fixture(scope="module")
def machine():
    return GaitMachine(puppy_model())


def path(curvature, speed=0.2, rest=1.0, walk=3.0, period=0.4, wobble=0.0):
    """A robot that rests, walks a circle, and rests."""
    time = np.arange(0, 2 * rest + walk, 0.01)
    gone = speed * np.clip(time - rest, 0, walk)
    heading = curvature * gone + wobble * np.sin(2 * np.pi * time / period)
    p = np.cumsum(speed * 0.01 * ((time > rest) & (time < rest + walk))[:, None]
                  * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    return time, p, heading, period


def test_recorded_heading_is_that_of_the_walk_between_its_rests():
    turn = recorded_turn(*path(math.radians(30), wobble=0.05))
    assert math.degrees(turn.heading) == pytest.approx(30, abs=1)
    assert turn.metres == pytest.approx(0.6, abs=0.1)
    assert turn.cycles >= 6
    assert turn.speed == pytest.approx(0.2, rel=0.05)


def test_gaps_do_not_matter_and_too_short_a_walk_is_refused():
    time, p, heading, period = path(-0.4)
    p[150:170] = np.nan
    assert recorded_turn(time, p, heading, period).heading == pytest.approx(-0.4, abs=0.02)
    with pytest.raises(InputError, match="3 or more whole cycles"):
        recorded_turn(*path(0.4, walk=0.9))
    with pytest.raises(InputError, match="was not seen for so long"):
        recorded_turn(time, np.full_like(p, np.nan), heading, period)


def test_estimate_weighs_the_recording_by_its_scatter_and_learns_the_gain():
    before = TurnEstimate.before(0.6, 8.0)
    surely, hardly = before.after(0.0, 0.4, 0.01), before.after(0.0, 0.4, 0.6)
    assert surely.turn == pytest.approx(-0.05, rel=0.01)
    assert hardly.turn == pytest.approx(-0.025, rel=0.01)
    weak = surely.after(surely.turn, 0.2, 0.01)  # half of what was expected: the robot answers half as strongly
    assert weak.mean[1] == pytest.approx(4.0, rel=0.35)
    assert weak.turn < surely.turn
    assert before.after(0.0, 9.0, 0.01).turn == -MOST_TRIM


def test_a_crooked_robot_is_straightened_by_what_it_records(machine):
    request = Request()
    response = turn_response(machine, request, SHAPE)
    walks = Straightener(machine.model, request, SHAPE, response, 0.8, SEARCH.time_step).robots(
        [machine.model.with_effects((CROOKED,))])
    degrees = np.degrees(walks[0])
    assert len(degrees) == METRES + 1
    assert abs(degrees[0]) > 10
    assert abs(degrees[METRES]) < 3
    assert summary_of_straightened(walks, response.nominal_gain)["untrimmed deg/m RMS"] == pytest.approx(abs(degrees[0]))


def test_turn_is_taken_back_as_far_as_legs_reach(machine):
    lax = Request()
    far = turned_by(machine, replace(lax, limits=replace(lax.limits, reach=1e-4)), replace(SHAPE, stride=0.1), 4.0)
    assert far.turn < 4.0
    assert turned_by(machine, lax, SHAPE, 0.05).turn == pytest.approx(0.05)


def test_a_turn_in_place_has_nothing_to_straighten(machine):
    with pytest.raises(InputError, match="no heading to straighten"):
        turn_response(machine, Request(way="turn"), SHAPE)


def test_a_slow_robot_turns_farther_in_a_metre_for_the_same_change(machine):
    response = TurnResponse(rate=4.0, speed=0.2, share=0.8)
    assert response.nominal_gain == pytest.approx(20.0)
    assert response.gain(0.2) == pytest.approx(16.0)
    assert response.gain(0.1) == pytest.approx(32.0)
    robot = machine.model.with_effects((EffectSpec("ground_friction", (), {"friction": 0.3}),))
    alone, told = turn_response(machine, Request(), SHAPE), turn_response(machine, Request(), SHAPE, [robot] * 4)
    assert (alone.share, alone.rate) == (1.0, told.rate)
    assert told.share == pytest.approx(turn_response(GaitMachine(robot), Request(), SHAPE).rate / alone.rate)
    assert abs(told.share - 1) > 0.02
    assert told.sd == LEAST_GAIN_SPREAD


def record(path, robot, commands, seconds):
    """The base's rigid body of a robot that plays the commands, as Motive would export it."""
    take = CompiledJob(Job(robot, SEARCH, commands, seconds, 0.3)).take()
    w, x, y, z = take.quat_WB.T  # capture axes: x forward, y up, z right
    asset = next(a for a, link in robot.rigid_bodies.items() if link == robot.base)
    body = BodyTrack(take.p_WB[:, [0, 2, 1]] * [1, 1, -1], np.column_stack([w, x, z, -y]))
    write_motive(path, {asset: body}, 1 / float(np.median(np.diff(take.time))))


def test_mocap_of_the_base_shows_what_the_rollout_does(machine, tmp_path):
    robot = machine.model.with_effects((CROOKED,))
    table = gait_table(machine, SHAPE)
    record(tmp_path / "walk.csv", robot, table.commands(8), table.start_seconds + 8 * table.period)
    seen = turn_in(tmp_path / "walk.csv", machine.model, table.period)
    (walked,) = Evaluator(machine, Request(), (), n_jobs=1).measure([(SHAPE, robot)])
    assert math.degrees(seen.heading) == pytest.approx(math.degrees(drift(Request(), walked)), abs=4)
    assert seen.sd < math.radians(5)


@pytest.mark.slow
def test_the_command_straightens_a_crooked_robot_from_its_recording(machine, tmp_path, capsys, monkeypatch):
    brief = CertifyOptions(draws=0, checked=0, seconds=2.0, step=2e-3, floor_seconds=0.5, watched=0, trimmed=0, n_jobs=1,
                           variants=("2 ms",))
    monkeypatch.setattr("workbench.gait.optimize.options_of", lambda *_: OptimizeOptions(certify=brief))
    monkeypatch.setattr("workbench.gait.engines.other_engine", lambda: None)
    model, gait = machine.model, data_file("gaits") / "plan-0.15" / "gait.csv"

    def recorded(motion, folder):
        """What `run` writes for the emulated robot: played by its servos' bus, filmed by cameras with noise."""
        robot = VirtualRobot(model.with_effects((CROOKED,)))
        bus = Bus(robot.port, family_of(model), {i: joint for joint, i in bus_ids(model).items()})
        folder.mkdir()
        done = run_on_robot(bus, model, load_motion(motion, model), 16, folder, lambda: "", virtual=robot)
        return folder / next(t["recording"] for t in done.takes if t["name"] == "gait")

    def heading_of(take):
        return math.degrees(turn_in(take, model, load_motion(gait, model).as_table().period).heading)

    take = recorded(gait, tmp_path / "first")
    before = heading_of(take)
    said = succeeds(capsys, "trim", str(take), "--gait", str(gait), "--out", str(tmp_path / "out"))
    assert f"recorded: {before:+.1f} deg/m" in said
    assert {"gait.csv", "certificate.json", "report.html"} <= {f.name for f in (tmp_path / "out").iterdir()}
    after = heading_of(recorded(tmp_path / "out" / "gait.csv", tmp_path / "second"))
    assert abs(before) > 20
    assert abs(after) < abs(before) / 3


def test_trim_refuses_a_gait_without_its_certificate(tmp_path, capsys):
    (tmp_path / "gait.csv").write_text("x")
    assert refused(capsys, "trim", "walk.csv", "--gait", str(tmp_path / "gait.csv"), "--out", str(tmp_path / "out"))
    assert not (tmp_path / "out").exists()
