"""The load of the servos in a motion, and their margins of torque and speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.robot import ServoConstants
from workbench.servo import ServoLaw
from workbench.types import Array, Mask

CREEP = 0.05
"""Joint speed [rad/s] below which Coulomb friction fades to zero with the speed: its direction at rest is not known."""
SURE = 3.0
"""Standard deviations by which a margin has to be negative: of hundreds of noisy samples the smallest lies about so far out."""


@dataclass(frozen=True)
class ServoLoad:
    """One servo over a whole motion. rms, peak: of the motor torque [N m]. torque_margin [N m], speed_margin [rad/s]: the
    smallest. beyond_fifth: share of the time above a fifth of the data sheet's stall torque, which ROBOTIS advises against.
    torque_sigma [N m], speed_sigma [rad/s]: standard deviations of the two margins there, from the measurement's noise."""

    rms: float
    peak: float
    torque_margin: float
    speed_margin: float
    beyond_fifth: float
    torque_sigma: float = 0.0
    speed_sigma: float = 0.0

    @property
    def feasible(self) -> bool:
        """Whether the servo can do all of it."""
        return self.torque_margin >= 0 and self.speed_margin >= 0

    @property
    def exceeded(self) -> bool:
        """Whether the servo cannot do all of it, beyond what noise makes of a motion that was differentiated twice."""
        return bool(self.torque_margin < -SURE * self.torque_sigma or self.speed_margin < -SURE * self.speed_sigma)


def motor_torque(servos: Sequence[ServoConstants], torque: Array, v: Array, a: Array, friction: bool = True) -> Array:
    """Torque that motor and gear must give, after back-EMF, so that `torque` (N, n) [N m] reaches the links:
    torque + reflected inertia · a, and with `friction` + viscous · v + Coulomb · sign(v), which fades to zero
    below CREEP (docs/formats.md, section 4)."""
    inertia, viscous, coulomb = (_row(servos, key) for key in ("reflected_inertia", "viscous_friction", "coulomb_friction"))
    needed = torque + inertia * a
    if friction:
        needed = needed + viscous * v + coulomb * np.clip(v / CREEP, -1, 1)
    return np.asarray(needed)


def torque_margin(servos: Sequence[ServoConstants], needed: Array, v: Array) -> Array:
    """Motor torque left at full duty (N, n) [N m], negative where the servo cannot: V/V_rated stall − back-EMF · speed along
    the torque − |needed|. A servo that is driven backwards has the back-EMF on its side."""
    return np.asarray(ServoLaw.of(servos).line.motor_torque(v * np.sign(needed)) - np.abs(needed))


def speed_margin(servos: Sequence[ServoConstants], v: Array) -> Array:
    """Distance (N, n) [rad/s] from the no-load speed at the supply voltage, where full duty gives no torque."""
    return np.asarray(ServoLaw.of(servos).line.no_load_speed - np.abs(v))


def servo_load(servo: ServoConstants, needed: Array, torque_left: Array, speed_left: Array, torque_sigma: Array | None = None,
               speed_sigma: Array | None = None) -> ServoLoad:
    """Over the samples (N,) that are not NaN; NaN throughout if there are none. torque_sigma, speed_sigma: (N,) standard
    deviations of the margins; left out: they are exact."""
    seen = np.isfinite(needed)
    if not seen.any():
        return ServoLoad(*[float("nan")] * 7)
    size = np.abs(needed[seen])
    return ServoLoad(
        rms=float(np.sqrt(np.mean(size**2))), peak=float(size.max()), torque_margin=float(torque_left[seen].min()),
        speed_margin=float(speed_left[seen].min()), beyond_fifth=float(np.mean(size > servo.stall_torque / 5)),
        torque_sigma=_at_least(torque_left[seen], torque_sigma, seen), speed_sigma=_at_least(speed_left[seen], speed_sigma, seen))


def _at_least(left: Array, sigma: Array | None, seen: Mask) -> float:
    return 0.0 if sigma is None else float(np.nan_to_num(sigma[seen][np.argmin(left)]))


def _row(servos: Sequence[ServoConstants], key: str) -> Array:
    return np.array([getattr(s, key) for s in servos], dtype=float)
