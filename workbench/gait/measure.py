"""Measures of a simulated gait: speed, heading, falls, torque, current, power, jerk."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from workbench.effects.apply import apply_to_commands, law_of
from workbench.gait.cycles import cycles_of, scatter_of
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.servo import ServoLaw
from workbench.types import Array

FALLEN_TILT, FALLEN_HEIGHT = np.radians(35), 0.55
"""A fall: the base tilts by more [rad], or sinks below this share of its height at rest."""
LASTING = 0.01
"""How long a torque has to last to count [s]; a servo's control loop turns once a millisecond, and the one-step impulses of a
rigid contact are nothing it is asked to hold."""
ROWS = 4e-3
"""Between the rows of a take [s] in which such a torque is looked for: three rows span nearly LASTING. In rows 10 ms apart a
contact's impulse that falls on one counts: 107 % of the torque-speed line where the share that lasts is 89 %."""
FUSE_WINDOW = 0.1
"""Over which supply current is averaged against the fuse [s]: fuses of 10 A carry twice that for longer."""
STALL_CURRENT = 1.5
"""[A] of an AX-12A at its stall torque and rated voltage (data sheet, 12 V, 1.5 N m)."""
STANDBY = 0.05
"""[A] that a servo takes at rest, and the controller too (AX-12A and CM-530 data sheets)."""


@dataclass(frozen=True)
class GaitMeasure:
    """One run, over whole cycles after the first. N m, m, rad, s, A, W.

    fell: at any time. velocity: forward and left [m/s], in the base's own heading. turn_rate [rad/s], to the left. gone: distance
    between the ends [m]; drift: change of heading on the way [rad], lateral: across the first heading [m]. tilt: largest [rad].
    rms: of each joint's torque, by the model's joints; torque_use: largest lasting share of the torque-speed line; speed_use:
    largest share of the no-load speed. current: mean of the supply; peak_current: largest over FUSE_WINDOW. power: mean,
    electrical; mechanical: mean output of the joints. jerk: RMS of the base's [m/s^3]. clearance: the least over feet and
    cycles of a foot's greatest height [m]; slip: mean speed over the ground of feet that touch it [m/s]; both NaN where not
    measured. peak: of each joint, the largest torque that lasts LASTING, over the same time as torque_use. scatter: from one of
    the cycles to the next, as `Scatter`. touched: whether something other than a foot touched the floor, or links each other, in
    a run that was not a fall.
    """

    fell: bool
    velocity: tuple[float, float]
    turn_rate: float
    gone: float
    drift: float
    lateral: float
    tilt: float
    rms: tuple[float, ...]
    torque_use: tuple[float, ...]
    speed_use: tuple[float, ...]
    current: float
    peak_current: float
    power: float
    mechanical: float
    jerk: float
    clearance: float = math.nan
    slip: float = math.nan
    peak: tuple[float, ...] = ()
    scatter: tuple[float, float] = (math.nan, math.nan)
    touched: bool = False

    @property
    def speed(self) -> float:
        """Forward [m/s]."""
        return self.velocity[0]


def fallen(joints: int) -> GaitMeasure:
    """The measure of a run that was given up because the robot lay on the floor, or its links met."""
    nothing = (0.0,) * joints
    return GaitMeasure(True, (0.0, 0.0), 0.0, 0.0, 0.0, 0.0, math.pi / 2, nothing, nothing, nothing, 0.0, 0.0, 0.0, 0.0, 0.0)


def measure(take: Take, model: RobotModel, begin: float, period: float, electrical: bool = True, end: float = math.inf,
            since: float | None = None) -> GaitMeasure:
    """Measures a free take with torques, from `begin` [s], when the first full cycle ends, in whole cycles of `period` [s].

    end: of the last cycle [s], where something follows it. since: from when on peak and torque_use count [s], to the take's end;
    None: in those cycles alone. fell, tilt and peak_current are of the whole take.
    electrical: whether current and power are wanted, which take the commands that reached each servo; else they are NaN."""
    assert take.p_WB is not None
    assert take.quat_WB is not None
    assert take.torque is not None
    assert take.v is not None
    w, x, y, z = take.quat_WB.T
    up = 1 - 2 * (x * x + y * y)
    heading = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    height = take.p_WB[:, 2] / take.p_WB[0, 2]
    fell = bool(up.min() < np.cos(FALLEN_TILT) or height.min() < FALLEN_HEIGHT or not np.isfinite(take.p_WB).all())
    cycles = max(int((min(float(take.time[-1]), end) - begin) / period + 1e-6), 1)
    first, last = np.searchsorted(take.time, [begin - 1e-9, begin + cycles * period - 1e-9])
    last = min(int(last), len(take) - 1)
    inside = slice(int(first), last + 1)
    time, p, h = take.time[inside], take.p_WB[inside], heading[inside]
    seconds = float(time[-1] - time[0])
    step = np.diff(p[:, :2], axis=0)
    middle = (h[1:] + h[:-1]) / 2
    forward = float((step[:, 0] * np.cos(middle) + step[:, 1] * np.sin(middle)).sum() / seconds)
    left = float((step[:, 1] * np.cos(middle) - step[:, 0] * np.sin(middle)).sum() / seconds)
    whole = p[-1, :2] - p[0, :2]
    law = law_of(model)
    rates = servo_rates(take)
    torque, v = take.torque[inside], rates[inside]
    unknown = np.full(len(take), np.nan)
    scatter = scatter_of(cycles_of(take, begin, period, end))
    current, power = supply(take, model, law) if electrical else (unknown, unknown)
    every = float(np.median(np.diff(time)))
    smooth = uniform_filter1d(current, max(1, round(FUSE_WINDOW / every)))
    counted = inside if since is None else slice(int(np.searchsorted(take.time, since - 1e-9)), len(take))
    return GaitMeasure(
        fell=fell, velocity=(forward, left), turn_rate=float((h[-1] - h[0]) / seconds), gone=float(np.hypot(*whole)),
        drift=float(h[-1] - h[0]), lateral=float(whole[1] * np.cos(heading[0]) - whole[0] * np.sin(heading[0])),
        tilt=float(np.arccos(np.clip(up.min(), -1, 1))), rms=_floats(np.sqrt((torque**2).mean(axis=0))),
        torque_use=_floats(_torque_use(law, take.torque[counted], rates[counted], every)),
        speed_use=_floats(np.quantile(np.abs(v), 0.995, axis=0) * law.back_emf / law.full_torque),
        current=float(current[inside].mean()), peak_current=float(smooth[take.time >= 0].max()),
        power=float(power[inside].mean()), mechanical=float(np.maximum(torque * v, 0).sum(axis=1).mean()),
        jerk=base_jerk(time, p), peak=_floats(_lasting(np.abs(take.torque[counted]), every)),
        scatter=(scatter.speed, scatter.heading))


def servo_rates(take: Take) -> Array:
    """Speeds (N, n) [rad/s] of the servos themselves; links behind play are seen to go faster for moments."""
    assert take.v is not None
    return take.v if take.servo_q is None else np.asarray(np.gradient(take.servo_q, take.time, axis=0))


def supply(take: Take, model: RobotModel, law: ServoLaw) -> tuple[Array, Array]:
    """Current [A] and power [W] (N,) that servos and controller draw from the supply.

    A servo's H-bridge passes the motor's current for the duty's share of the time: supply current is duty times motor torque over
    torque per ampere. The output of a driven motor is not credited. The duty is that of the servo law on the ramped reference
    that reached the servos and the servos' own angles.
    """
    q = take.q if take.servo_q is None else take.servo_q
    assert take.v is not None
    if take.commands is None:
        duty = law.duty(-q)
    else:
        duty = law.duty(apply_to_commands(take.commands.reordered(take.joints), model).reference(take.time) - q)
    motor = duty * law.full_torque - law.back_emf * servo_rates(take)
    ampere = np.array([model.servo(j).stall_torque for j in model.joints]) / STALL_CURRENT
    voltage = law.full_torque / law.torque_per_volt
    drawn = np.maximum(duty * motor / ampere, 0.0)
    standby = STANDBY * (len(model.joints) + 1)
    return drawn.sum(axis=1) + standby, (drawn * voltage).sum(axis=1) + standby * float(voltage.mean())


def as_plain(m: GaitMeasure) -> dict[str, object]:
    """Plain types, for JSON."""
    return {k: list(v) if isinstance(v, tuple) else v for k, v in vars(m).items()}


def from_plain(content: Mapping[str, object]) -> GaitMeasure:
    """What `as_plain` gave."""
    return GaitMeasure(**{k: tuple(v) if isinstance(v, list) else v for k, v in content.items()})  # type: ignore[arg-type]


def _torque_use(law: ServoLaw, torque: Array, v: Array, every: float) -> Array:
    """Largest share (n,) of the torque available at the servo's speed that is needed for LASTING or longer."""
    share = np.abs(torque) / np.maximum(law.line.available(torque, v), 0.02 * law.full_torque)
    return _lasting(share, every)


def _lasting(x: Array, every: float) -> Array:
    """The largest value (n,) of each column that lasts LASTING, of samples `every` [s]."""
    return np.asarray(minimum_filter1d(x, math.ceil(LASTING / every - 1e-6), axis=0).max(axis=0))


def base_jerk(time: Array, p: Array) -> float:
    """RMS of the third derivative of the base's path, smoothed over 50 ms so that single impacts of feet do not decide."""
    every = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    window = max(3, round(0.05 / every))
    if len(time) < 3 * window + 4:
        return float("nan")
    smooth = uniform_filter1d(p, window, axis=0)[window:-window]  # the filter makes up what lies beyond the ends
    jerk = np.diff(smooth, n=3, axis=0) / every**3
    return float(np.sqrt((jerk**2).sum(axis=1).mean()))


def _floats(x: Array) -> tuple[float, ...]:
    return tuple(float(v) for v in x)
