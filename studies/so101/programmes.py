"""The recorded programmes, which of them serve for what, and their clock.

The split was written down before any model of this study was judged on it, though after a rough one, not kept, had been looked
at on five programmes, of which four validate now: of each kind of programme (all joints by
sweeps, slow ramps, steps; single and paired joints; paths through poses) about half are for training.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies.so101.robot import COUNT
from workbench.files import InputError
from workbench.recording.formats.read import read_recording
from workbench.recording.formats.sage import JOINTS, sage_programmes
from workbench.recording.recording import Recording
from workbench.types import Array

FILE = "so101_programmes.npz"
TRAINING = (
    "frequency_sweep", "backlash_detection", "coupled_joints", "friction_gravity", "step_response", "hover_positions",
    "random_waypoints", "dual_joint_rotation_pitch", "single_joint_wrist_pitch", "wave_motion", "spiral_motion",
    "center_workspace", "square_pattern", "large_amplitude")
VALIDATION = (
    "actuator_bandwidth", "chirp_sweep", "dual_joint_elbow_wrist", "fast_transitions", "figure_eight", "lissajous_pattern",
    "oscillation_low_freq", "perturbation_test", "reach_and_return", "single_joint_rotation", "slow_precision",
    "symmetric_motion", "triangle_wave", "velocity_ramp")
NOMINAL_RATE = 50.0


@dataclass(frozen=True)
class Programme:
    """One programme, columns in JOINTS' order. time: stamps of measurements (N,) [s]; command_time: of goals that change [s];
    sent, read: goal and position (N, 6) [rad, the jaw as a share of its range]; speed (N, 6) [rad/s of the servo]; register
    (N, 6): `tau_abs`."""

    name: str
    time: Array
    command_time: Array
    sent: Array
    read: Array
    speed: Array
    register: Array

    @property
    def period(self) -> float:
        """Median time between two rows [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def trained(self) -> bool:
        """Whether it may be fitted to."""
        return self.name in TRAINING


def load_programmes(data: Path) -> list[Programme]:
    """All programmes of the split that the folder's npz holds; InputError where one is missing."""
    path = data / FILE
    known = sage_programmes(path)
    if not known:
        raise InputError(path, "not a file of SAGE programmes; expected the folder of the SO-101's recordings as --data")
    missing = [n for n in (*TRAINING, *VALIDATION) if n not in known]
    if missing:
        raise InputError(path, f"programme '{missing[0]}' is missing")
    return [programme(read_recording(f"{path}#{name}")) for name in (*TRAINING, *VALIDATION)]


def programme(r: Recording) -> Programme:
    """A recording as arrays."""
    def columns(what: str) -> Array:
        return np.column_stack([r.channels[f"{what}.{j}"] for j in JOINTS])

    assert r.commands is not None
    sent_at = r.commands.times + float(r.metadata["first command"])
    return Programme(r.metadata["programme"], r.time, sent_at, columns("goal"), columns("position"), columns("velocity"),
                     columns("torque_magnitude"))


def jaw_range(programmes: list[Programme]) -> float:
    """Range of the jaw [rad] of which its positions are shares, from the size of the encoder's count in them."""
    steps = np.concatenate([np.abs(np.diff(p.read[:, JOINTS.index("Jaw")])) for p in programmes])
    return float(COUNT / steps[steps > 1e-9].min())


@dataclass(frozen=True)
class Clock:
    """Over all programmes: median period [s], largest deviation from it [s], share of a second by which a second of the
    programme (at 50 Hz) takes longer, and the largest difference between stamps of a row's command and measurement [s]."""

    period: float
    jitter: float
    stretch: float
    apart: float


def clock(programmes: list[Programme]) -> Clock:
    """Information from the time stamps."""
    steps = np.concatenate([np.diff(p.time) for p in programmes])
    period = float(np.median(steps))
    whole = sum(p.time[-1] - p.time[0] for p in programmes) / sum((len(p.time) - 1) / NOMINAL_RATE for p in programmes)
    apart = max(float(np.abs(p.command_time[:, None] - p.time[_nearest(p)]).min(axis=1).max()) for p in programmes)
    return Clock(period, float(np.abs(steps - period).max()), float(whole - 1), apart)


def _nearest(p: Programme) -> NDArray[np.int_]:
    """Rows on both sides of each command (K, 2)."""
    at = np.searchsorted(p.time, p.command_time)
    return np.column_stack([np.maximum(at - 1, 0), np.minimum(at, len(p.time) - 1)])
