"""The page of the SO-101's study: tables of the measurements, and their interpretation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from studies.so101.programmes import Clock, Programme
from studies.so101.response import Response
from studies.so101.rest import Current, Fastest, NamePosterior
from studies.so101.zero import Zero
from workbench.recording.formats.sage import JOINTS
from workbench.robot import RobotModel
from workbench.types import Array
from workbench.view.report.page import Table, Text

DEGREES = float(np.degrees(1))
WHAT = (
    "A six-joint SO-101 arm of Feetech STS3215 servos, 28 named programmes (isaac-sim2real/sage). Fourteen are for training, "
    "fourteen for validation, a split by name that was written down before these models were judged on it. Everything below "
    "but the clock and the errors under Validation comes from training programmes. Angles are the servos' degrees.")


def clock_text(clock: Clock, count: int) -> Text:
    """Where the clock is."""
    return Text(
        f"Rows are {1e3 * clock.period:.2f} ms apart (never more than {1e3 * clock.jitter:.1f} ms off), so the {count} "
        f"programmes, written for 50 Hz, take {100 * clock.stretch:.2f} % longer. A row's command and measurement have "
        f"one stamp: they never differ by more than {1e6 * clock.apart:.0f} µs. The recorder's source "
        "(so101_lerobot_collector.py) shows its meaning: the time before six goals are written one by one and eighteen registers "
        "are then read one by one. So positions are read after their stamp, later joints later; the files do not contain how "
        "much later, and a delay in the table below is the servo's own less that.")


def response_table(moving: Sequence[Response]) -> Table:
    """While moving."""
    rows = [[r.joint, r.late.text(0, 1e3), r.delay.text(0, 1e3), r.friction.text(2, DEGREES), f"{DEGREES * r.left:.2f}",
             f"{DEGREES * r.spread:.2f}"] for r in moving]
    header = ("joint", "late in all [ms]", "of it pure delay [ms]", "dry friction as error [deg]", "RMS left [deg]", "of [deg]")
    return Table(header, rows, "Moving joints, by regression; 90 % intervals by bootstrap over programmes. Total delay: delay "
                 "and lag. The jaw's error in shares of its range, as if they were radians.")


def rest_table(resting: Mapping[str, NamePosterior | None], scale: float) -> Table:
    """At rest."""
    rows = []
    for joint in JOINTS:
        s = resting[joint]
        by = DEGREES * (scale if joint == "Jaw" else 1.0)
        rows.append([joint, *(["too few"] * 5 if s is None else [
            s.up.text(2, by), s.down.text(2, by), s.width.text(2, by), f"{s.load:.2f}", str(s.count)])])
    return Table(("joint", "after rising [deg]", "after falling [deg]", "half apart [deg]", "load [N m]", "holds"), rows,
                 "Goal less position of joints that stand, by where the goal came from. Load: gravity's torque by the URDF.")


def zero_table(zeros: Sequence[Zero]) -> Table:
    """Signs and zeros."""
    rows = [[z.joint, z.sign.text(2, DEGREES), f"{1 / z.sign.value:.1f}", z.offset.text(0, DEGREES), f"{100 * z.gain:.1f} %"]
            for z in zeros]
    header = ("joint", "error for a N m of gravity [deg]", "so stiffness [N m/rad]", "zero moved by [deg]", "squares less by")
    return Table(header, rows, "Positive: gravity turns the joint the way the URDF says.")


def speed_table(speeds: Sequence[Fastest], laws: Sequence[Current]) -> Table:
    """Speeds, and the register's law."""
    by = {c.joint: c for c in laws}
    rows = []
    for f in speeds:
        c = by.get(f.joint)
        rows.append([f.joint, f"{f.asked:.2f}", f"{f.went:.2f}", "–" if c is None else c.power.text(2),
                     "–" if c is None else c.scale.text(4, 1 / DEGREES**2)])
    return Table(("joint", "goal's fastest [rad/s]", "servo's fastest [rad/s]", "power of the error in tau_abs",
                  "tau_abs over error² [1/deg²]"), rows)


def validation_table(by_model: Mapping[str, Array]) -> Table:
    """RMS by joint and model."""
    rows = [[name, *map(_number, [*values, np.sqrt(np.mean(np.square(values)))])] for name, values in by_model.items()]
    return Table(("model", *JOINTS, "all"), rows, "RMS error on the fourteen validation programmes, deg; – where nobody "
                 "published a joint's numbers.")


def programme_table(validation: Sequence[Programme], by_model: Mapping[str, Array]) -> Table:
    """RMS over joints, by programme and model."""
    rows = [[p.name, *(_number(np.sqrt(np.mean(np.square(e[k])))) for e in by_model.values())] for k, p in enumerate(validation)]
    return Table(("programme", *by_model), rows, "RMS over the six joints, deg.")


def _number(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else "–"


def effects_table(model: RobotModel) -> Table:
    """Additions of a model to the nominal one."""
    rows = [[e.effect, ", ".join(e.where) or "robot",
             ", ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in e.parameters.items())]
            for e in model.effects]
    return Table(("effect", "where", "parameters"), rows)
