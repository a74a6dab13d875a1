"""Every threshold of a comparison, with unit, meaning and reason, in one place."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians


@dataclass(frozen=True)
class CompareOptions:
    """Options for comparing two takes."""

    gain_span: float = 0.25
    """Span over which path and heading are compared [s]: about half a cycle of a gait."""
    lead: float = 0.3
    """Rest before the first command of each rollout [s]: what registration takes for the resting pose."""
    lift: float = 0.005
    """A foot is off the ground above this share of the height at which the base rests: 1 mm for a puppy, five times what capture
    noise makes of a foot's height (0.2 mm in the practice sessions). On simulated walks the duty factor then lies within 0.04
    above that from contact forces."""
    stance_load: float = 0.05
    """A foot stands where it carries more than this share of the robot's mean load in the simulation: a quarter of the load is
    five times as much."""
    first_move: float = radians(1.0)
    """A recording without commands starts where a joint has left its first angle by this [rad]: more than three counts of an
    AX-12A."""
    most_lag: float = 0.2
    """Largest delay between recording and simulation that is searched for [s]; buses and servos delay by hundredths of a
    second."""
    speed_window: float = 0.1
    """Span of the straight line whose slope is a speed [s]: a fifth of a gait's cycle."""
    shortest: float = 0.03
    """Stance or swing shorter than this is chatter, not a step [s]."""
    fell_tilt: float = radians(60.0)
    """A base that leans further counts as fallen [rad]."""
    fell_height: float = 0.5
    """Share of its height at rest below which a base counts as fallen."""
    engines_apart: float = 1e-6
    """Largest difference [rad, m] at which rollouts by Drake and by the compiled station count as equal: those of a walk
    differed by 3e-14 rad."""
    camera_rate: float = 120.0
    """Frames per second of the virtual robot's cameras."""


@dataclass(frozen=True)
class FileLimits:
    """Limits beyond which a value in a file is probably a mistake of its author."""

    most_seconds: float = 86_400.0
    """Largest time of a start, and of a prediction [s]: a day."""
    most_frames: int = 10_000_000
    """Most frames of a prediction: hours at any camera's rate."""
    smallest_motion: float = radians(1.6)
    """A motion of a robot is larger than this [rad]; a value in radians read as degrees is not (a right angle is 1.6)."""
    largest_angle: float = radians(200.0)
    """No servo's goal is this far from its centre [rad]."""
    longest: float = 600.0
    """A longer take or motion is usually a mistake [s]: simulating it takes hours."""
    slowest_pose: float = 8.0
    """Median time between a motion's poses [s] above which the times are probably milliseconds; no gait or test rests as long."""
    shortest: float = 0.5
    """A shorter take tells little [s]: the search compares stretches of this length."""
    least_seconds: float = 0.1
    """Of a take that is used [s]: no servo answers a goal in less; a shorter one has times in another unit."""
    fewest_frames: int = 20
    """Of a take."""
    longest_name: int = 100
    """Longest name of a take [bytes]: output files are named after it, with prefix and suffix, and file systems allow 255."""
    moves_at_once: float = radians(30.0)
    """Speed of a joint in a capture's first frames [rad/s] at which the robot does not stand. Where the bundled synthetic walk is
    cut within its gait, a third of its joints or more are faster at 33 of 36 places; at rest none is."""
    first_frames: float = 0.03
    """Duration of each of the two consecutive stretches in which a joint has to exceed that speed [s]."""
    share_moving: float = 1 / 3
    """A capture is refused if at least this share of its visible joints moves so fast."""


@dataclass(frozen=True)
class SparcOptions:
    """The spectral arc length's own numbers, from its paper (Balasubramanian et al. 2015)."""

    cutoff: float = 10.0
    """Highest frequency that counts [Hz]."""
    threshold: float = 0.05
    """Amplitude, as a share of the largest, below which the spectrum has ended."""
    padding: int = 4
    """Zero padding: the spectrum has 2^padding times the points of the next power of two."""


COMPARE = CompareOptions()
SPARC = SparcOptions()
FILES = FileLimits()
