import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from tests.view_takes import capture, small_robot, swing
from workbench.compare.comparison import compare_takes
from workbench.compare.footfalls import FootPhases, force_phases
from workbench.compare.results import Channel
from workbench.files import InputError
from workbench.recording.take import Take
from workbench.robot import RobotModel, ServoConstants, data_file
from workbench.view import figures
from workbench.view.figures.stance import intervals
from workbench.view.figures.style import NOISE, RECORDED, SIMULATED, STANCE


@pytest.fixture
def model(tmp_path: Path) -> RobotModel:
    return small_robot(tmp_path)


@pytest.fixture
def takes(model: RobotModel) -> tuple[Take, Take]:
    return swing(model), capture(swing(model, delay=0.05))


def everything(model: RobotModel, simulated: Take, recorded: Take) -> dict[str, Figure]:
    stance = figures.stance_of(force_phases(simulated), simulated)
    assert simulated.torque is not None
    assert simulated.v is not None
    channels = compare_takes(recorded, simulated, model).joints
    wrench = np.outer(np.sin(simulated.time), np.arange(1, 7))
    return {
        "joint_overlay": figures.joint_overlay("flm", simulated, recorded, noise=1e-3, floor=5e-4,
                                                stance=figures.by_joint(stance, model)),
        "joint_overlay, alone": figures.joint_overlay("flm", simulated),
        "joint_grid": figures.joint_grid(simulated, recorded, noise={"flm": 1e-3}, stance=figures.by_joint(stance, model)),
        "phase_portrait": figures.phase_portrait("flm", simulated, recorded),
        "body_path": figures.body_path(simulated, recorded, {"other": simulated}),
        "body_attitude": figures.body_attitude(simulated, recorded),
        "footfalls": figures.footfalls(stance, stance, span=(0, 1), unseen={"flb": np.array([[0.2, 0.3]])}),
        "joint_errors": figures.joint_errors(channels),
        "joint_torques": figures.joint_torques(simulated.time, simulated.joints, {"torque": simulated.torque}, limit={"flm": 1}),
        "servo_margins": figures.servo_margins(model, simulated.joints, simulated.torque, simulated.v),
        "base_wrench": figures.base_wrench(simulated.time, wrench, np.full_like(wrench, 0.1), weight=9.0),
        "film_strip": figures.film_strip(model, simulated, recorded),
    }


def test_every_axis_names_its_unit(model: RobotModel, takes: tuple[Take, Take]) -> None:
    for name, figure in everything(model, *takes).items():
        axes = [a for a in figure.axes if a.axison]
        bottom = [a for a in axes if a.get_xlabel()]
        left = [a for a in axes if a.get_ylabel()]
        assert bottom, name
        for label in [a.get_xlabel() for a in bottom] + [a.get_ylabel() for a in left]:
            assert "[" in label or label == "foot", f"{name}: {label}"
        assert min(text.get_fontsize() for text in figure.findobj(mpl.text.Text) if text.get_text()) >= 10, name


def test_drawing_leaves_no_trace(model: RobotModel, takes: tuple[Take, Take]) -> None:
    before = dict(mpl.rcParams)
    everything(model, *takes)
    assert dict(mpl.rcParams) == before
    code = "import sys, workbench.view.figures.files; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_same_takes_same_bytes(model: RobotModel, takes: tuple[Take, Take]) -> None:
    first, second = (figures.joint_overlay("flm", *takes) for _ in range(2))
    encoded = figures.encode(first)
    assert encoded == figures.encode(second) == figures.encode(first)
    assert encoded.mime == "image/svg+xml"


def test_a_figure_with_a_hundred_curves_becomes_pixels() -> None:
    figure = Figure()
    noise = np.random.default_rng(0).normal(size=(4000, 20))
    figure.subplots().plot(noise)
    encoded = figures.encode(figure)
    assert encoded.mime == "image/png"
    assert encoded.content.startswith(b"\x89PNG")


def test_the_error_strip_is_measured_less_simulated(model: RobotModel, takes: tuple[Take, Take]) -> None:
    simulated, recorded = takes
    top, strip = figures.joint_overlay("flm", simulated, recorded, noise=1e-3).axes
    measured = next(line for line in top.lines if line.get_color() == RECORDED)
    column = recorded.column("flm")
    np.testing.assert_allclose(measured.get_ydata(), np.degrees(recorded.q[:, column]))
    error = strip.lines[-1]
    model_angle = np.interp(recorded.since_start, simulated.time, simulated.q[:, simulated.column("flm")])
    expected = np.degrees(recorded.q[:, column] - model_angle)
    inside = np.isfinite(np.asarray(error.get_ydata(), dtype=float))
    assert not inside[60:80].any()  # the gap
    np.testing.assert_allclose(np.asarray(error.get_ydata())[inside], expected[inside], atol=1e-6)
    after = inside & (recorded.since_start >= 0)
    assert f"{np.sqrt(np.mean(expected[after] ** 2)):.2f}° RMS" in strip.get_title(loc="left")
    band = next(p for p in strip.patches if mpl.colors.to_hex(p.get_facecolor()).upper() == NOISE)
    assert band.get_height() == pytest.approx(4 * np.degrees(1e-3))


def test_stance_is_shaded_where_the_joints_foot_stands(model: RobotModel, takes: tuple[Take, Take]) -> None:
    simulated, _ = takes
    stance = figures.stance_of(force_phases(simulated), simulated)
    (axes,) = figures.joint_overlay("flm", simulated, stance=figures.by_joint(stance, model)).axes
    shaded = [p for p in axes.patches if mpl.colors.to_hex(p.get_facecolor()).upper() == STANCE]
    np.testing.assert_allclose([[p.get_x(), p.get_x() + p.get_width()] for p in shaded], stance["flb"])
    half = np.pi / 8
    np.testing.assert_allclose(stance["flb"][1], [2 * half, 3 * half], atol=0.02)


def test_path_and_legend_say_distance_and_heading(model: RobotModel, takes: tuple[Take, Take]) -> None:
    simulated, recorded = takes
    figure = figures.body_path(simulated, recorded)
    line = next(line for line in figure.axes[0].lines if line.get_color() == SIMULATED)
    assert simulated.p_WB is not None
    np.testing.assert_allclose(np.asarray(line.get_xdata())[-1], 100 * simulated.p_WB[-1, 0])
    turned = np.degrees(0.2 * simulated.time[-1])
    says = f"{100 * simulated.p_WB[-1, 0]:.1f} cm, +{turned:.1f}°"
    assert any(says in text.get_text() for text in figure.legends[0].get_texts())


def test_roll_and_pitch_have_the_signs_that_the_axis_says(model: RobotModel, takes: tuple[Take, Take]) -> None:
    from scipy.spatial.transform import Rotation

    simulated, _ = takes
    rising = np.clip(simulated.time, 0, None)
    for axis, row in ((0, 1), (1, 2)):  # roll about x: left side up; pitch about y: nose down
        turn = np.zeros((len(simulated), 3))
        turn[:, axis] = 0.3 * rising
        quat = Rotation.from_rotvec(turn).as_quat(scalar_first=True)
        axes = figures.body_attitude(replace(simulated, quat_WB=quat)).axes[row]
        drawn = np.asarray(axes.lines[0].get_ydata())
        np.testing.assert_allclose(drawn, np.degrees(0.3 * rising), atol=1e-9)


def test_a_take_without_a_base_has_an_empty_path(model: RobotModel, takes: tuple[Take, Take]) -> None:
    fixed = replace(takes[0], p_WB=None, quat_WB=None, base="fixed")
    for figure in (figures.body_path(fixed), figures.body_attitude(fixed)):
        figures.encode(figure)
        drawn = [np.asarray(line.get_ydata(), dtype=float) for axes in figure.axes for line in axes.lines]
        assert all(np.isfinite(y).sum() <= 2 for y in drawn)  # but for the lines of reference


def test_duty_factor_leaves_out_what_was_not_seen() -> None:
    stance = {"flb": np.array([[0.0, 0.5]])}
    figure = figures.footfalls(stance, stance, span=(0.0, 1.0), unseen={"flb": np.array([[0.6, 0.85]])})
    texts = [t.get_text() for t in figure.axes[0].texts]
    assert "0.50" in texts
    assert f"{0.5 / 0.75:.2f}" in texts


def test_error_bars_tell_what_is_left_to_explain() -> None:
    channels = {"flb": Channel(error=0.0021, noise=0.002), "flm": Channel(error=0.02, noise=0.002, floor=0.001)}
    axes = figures.joint_errors(channels).axes[0]
    labels = [t.get_text() for t in axes.get_yticklabels()]
    assert labels == ["flm", "flb"]
    bars = {labels[round(p.get_y() + p.get_height() / 2)]: mpl.colors.to_hex(p.get_facecolor()).upper()
            for p in axes.patches if p.get_height() == 0.5}
    assert bars["flm"] == RECORDED
    assert bars["flb"] == SIMULATED


def test_servo_shares_follow_the_torque_speed_line(model: RobotModel) -> None:
    servo = ServoConstants()
    speed, torque = 2.0, 0.5
    figure = figures.servo_margins(model, ("flm",), np.array([[torque], [np.nan]]), np.array([[speed], [np.nan]]))
    bars = figure.axes[1].patches
    left = servo.torque_at_full_duty - servo.back_emf * speed
    assert bars[0].get_width() == pytest.approx(100 * torque / left)
    assert bars[1].get_width() == pytest.approx(100 * speed * servo.back_emf / servo.torque_at_full_duty)


@pytest.mark.parametrize(("on", "expected"), [
    ([False, False], np.zeros((0, 2))), ([True, True], [[0, 1]]), ([False, True], [[1, 1]]), ([True, False], [[0, 1]]),
])
def test_intervals(on: list[bool], expected: object) -> None:
    np.testing.assert_allclose(intervals(np.arange(len(on), dtype=float), np.array(on)), expected)


def test_unseen_feet_are_told_apart_from_lifted_ones(takes: tuple[Take, Take]) -> None:
    take = takes[1]
    known = np.ones(len(take), dtype=bool)
    known[60:80] = False
    phase = FootPhases(stance=known & (take.since_start > 0), known=known, falls=np.zeros(0), duty=0.5)
    (gap,) = figures.unseen_of({"flb": phase}, take)["flb"]
    np.testing.assert_allclose(gap, [take.since_start[60], take.since_start[80]])


@pytest.mark.parametrize("ending", ["svg", "png", "pdf"])
def test_figures_are_saved_whole(tmp_path: Path, takes: tuple[Take, Take], ending: str) -> None:
    path = figures.save_figure(figures.phase_portrait("flm", *takes), tmp_path / f"figure.{ending}")
    assert path.stat().st_size > 5000
    assert [p.name for p in tmp_path.iterdir() if p.suffix != ".sdf"] == [path.name]


def test_unknown_endings_are_refused(tmp_path: Path, takes: tuple[Take, Take]) -> None:
    figure = figures.phase_portrait("flm", *takes)
    with pytest.raises(InputError, match=r"\.svg, \.png or \.pdf"):
        figures.save_figure(figure, tmp_path / "figure.jpg")


def test_a_robot_left_far_behind_is_told_and_does_not_shrink_the_other(model: RobotModel) -> None:
    ahead = swing(model)
    assert ahead.p_WB is not None
    behind = replace(ahead, name="behind", p_WB=ahead.p_WB - np.outer(3.0 * (ahead.time > ahead.time.mean()), [1.0, 0.0, 0.0]))
    alone, both = (figures.film_strip(model, ahead, other).axes[-1] for other in (None, behind))
    assert np.ptp(both.get_xlim()) <= 2.5 * np.ptp(alone.get_xlim())
    assert [t.get_text() for t in both.texts] == ["\u2190 300 cm"]


def test_the_film_strip_of_an_arm_without_feet_shows_all_of_it_at_every_instant() -> None:
    """Its last link has no joint at its end and no foot."""
    import workbench

    arm = workbench.load_model(data_file("tutorial_arm"))
    time = np.linspace(0, 1, 21)
    q = np.outer(np.sin(3 * time), np.ones(len(arm.joints)))
    take = Take(name="arm", time=time, joints=arm.joints, q=q, source="simulation", base="fixed", starts_at=0.0)
    for axes in figures.film_strip(arm, take, instants=4).axes:
        (sticks,) = axes.collections
        points = np.concatenate(sticks.get_segments())
        assert len(sticks.get_segments()) == len(arm.joints) + 1
        for of, (low, high) in zip(points.T, (axes.get_xlim(), axes.get_ylim())):
            assert low <= of.min() <= of.max() <= high
        assert np.ptp(points, axis=0).max() > 15  # the arm is 0.3 m long
