"""Every number that a diagnosis is run with, outside the selection: unit, meaning and reason in one place for each stage."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class ProblemOptions:
    """From recordings to residuals: rollouts, windows, stretches, gaps."""

    time_step: float = 2e-3
    """Time step of the rollouts [s]. Its error on the nominal robot, from finer steps, is subtracted from every residual."""
    coarse: float = 2.0
    """Time step of a first look, in search steps: good for differences alone."""
    fine: float = 0.25
    """Time step of last numbers, in search steps."""
    rest: float = 0.1
    """Rest before the first command in rollouts [s]."""
    station_joints: int = 17
    """What building a station costs, in joints. Measured: 30 ms for a second of one joint, 33 of three joints, 53 of fifteen."""
    puppy_joints: int = 15
    """Joints of the robot in whose seconds work is counted."""
    window: float = 0.6
    """Between two base resets of a walk [s]. Over as much even a robot that is about to tip over goes where another engine sends
    it, too."""
    settles: float = 0.1
    """After a base reset, until feet have found the floor again [s]: a millimetre's fall takes 15 ms."""
    forgets: float = 0.3
    """Time after the first command of a log that does not begin at rest in neutral which is not judged [s]: its initial velocity
    is estimated from a few noisy positions, and a servo takes two or three times its rise time to forget an error of it."""
    pose_frames: int = 7
    """Frames over which the recorded base's pose and velocity are read, by a parabola: 60 ms at 120 Hz."""
    state_spans: tuple[float, ...] = (0.06, 0.08, 0.1, 0.14)
    """Spans of the positions of a servo log from which the state at a window's start is estimated [s], from about a servo's rise
    time. The widest whose speed agrees with every narrower one is used."""
    state_agree: float = 2.0
    """Standard errors within which these speeds agree."""
    state_order: int = 3
    """Of the polynomial through them: over so long a servo's acceleration changes."""
    states_kept: int = 256
    """Takes and horizons of which states are kept, as they are played again and again."""
    together: int = 64
    """Requests for servo logs that a thread plays at once: of several structures, each with enough robots for full lanes. What
    was played is kept only after all of them."""
    played: int = 96
    """Angles of servo logs that are played at once [MiB]: 64 rollouts of 200 s of three joints at 1 ms are 290."""
    loaded: float = 1.0
    """Torque of gravity, in dry frictions, from which on a joint is loaded: friction holds against less, so that nothing moves in
    its gear."""
    poses_sampled: int = 50
    """Poses of a log from which its load is read: it changes with the angle alone."""
    block: float = 0.4
    """Length of a stretch [s]."""
    uses: tuple[str, ...] = ("fit", "choose", "fit", "validate")
    """Use of consecutive stretches: two are fitted, one decides, one validates."""
    part: float = 0.1
    """Length of a part [s]: on a fixed base, a joint forgets within one."""
    parts: int = 3
    """On a fixed base, one in so many parts that do not validate decides: a joint may meet its stop only once."""
    deciding_part: int = 1
    """Which of these."""
    least_body_sigma: tuple[float, ...] = (1e-3, 1e-3, 0.01, 5e-4, 0.004, 0.004)
    """Of the body's channels [m, m, rad, m, rad, rad]: below this no contact model is believed."""
    still: float = 0.02
    """A joint whose recorded angle covers less than this tells nothing of its servo or gear [rad]."""
    fastest: float = 2.0
    """How many times as fast as they were sent a model may play commands: the end of a clock's range."""
    late: float = 0.1
    """Shift of an estimated start that every model is allowed [s]: a robot whose servos received each other's speeds sets out so
    unlike the nominal one that its start was estimated 62 ms early."""
    shifts: int = 4
    """Steps in which the start is shifted."""
    smoothing: float = 0.065
    """Span of the running mean in which a gap is looked for [s]: noise averages out, model errors do not."""
    gap_ratio: float = 1.3
    """RMS over sigma from which on a channel has a gap. Quiet practice recordings stay below 1.15."""
    gap_ratio_smoothed: float = 2.0
    """The same of running means; quiet recordings stay below 1.8."""
    follows: float = 0.5
    """On a free base, a joint that errs less than this share of the worst one, and not at all on a fixed base, errs because the
    worst one does."""
    long: float = 60.0
    """Recording from which on a search looks at a part of it [s]."""
    looked_at: float = 40.0
    """Duration of the part that is searched [s]; required gains are scaled with recordings of this length."""
    piece: float = 12 * 0.4
    """Increment of that part [s]: three times the stretches of the four uses."""
    starved: float = 0.1
    """If the selection frames contain less than this share of a channel's excess error on a fixed base, they are extended."""
    heavy: float = 0.15
    """Share of the robot's mass from which on a link's centre of mass is a candidate: of lighter ones it hardly shows."""
    most_stretches: int = 10_000
    """More than a take has: numbers of stretches count on by as many from take to take."""
    remembered: int = 256
    """Rollouts that are held in memory [MiB], those used last; others are read again from disk, where a folder keeps them."""
    engines_apart: float = 0.1
    """Of a channel's sigma: engines that part by more, RMS over a take, are not taken for one."""
    engines_compared: float = 3.0
    """So much of each take is rolled out by both [s]: they part within the first steps or windows, or not at all. In fourteen
    diagnoses they differed by 8e-7 sigma at most."""
    engines_compared_whole: float = 20.0
    """Length of one take, of a walk if there is one [s], for effects that appear late, as a stop that is reached or a motor that
    fades."""
    heavy_trunk: float = 0.09
    """The same for links that are not part of a leg: a load on them tips the robot, while their own joint hardly responds."""


@dataclass(frozen=True)
class ReadOffOptions:
    """Estimators without a search: geometry, stops, mounts, frames, dropped commands."""

    register_exact: float = 0.005
    """Standard deviation of a value set by a servo's register, as a share: the servo itself calculates with that number."""
    least_along: float = 0.5
    """Cosine between a link's length and what of it two axes tell, at least."""
    length_error: float = 1e-4
    """Least error of a take's distance between axes [m]."""
    direction_error: float = math.radians(0.25)
    """The same of a direction, for the model's droop [rad]."""
    geometry_sure: float = 5.0
    """Standard deviations from which on a link is not as drawn."""
    least_change: float = 5e-4
    """Change of length below which no gait shows anything [m]."""
    least_turned: float = math.radians(1.5)
    """Turn of a horn below which no gait shows anything [rad]."""
    geometry_worse: float = 0.05
    """Share of chi squared by which takes may be told worse with the measured geometry, as beside what else is missing the right
    leg may walk the wrong way."""
    least_cut: float = math.radians(1.5)
    """A stop is a candidate where the model goes this much further than the recording ever does [rad]."""
    at_stop: float = math.radians(0.6)
    """And where the recording is this close to its end whenever the model is beyond it [rad]. A limit that a take with the same
    zero passes by more is no stop: noise of five frames is a tenth of that, a stop of the second engine gave by 0.4 deg."""
    rare: float = 0.02
    rocking_noise: float = 2.0
    """Share of frames at either end that are ignored when the rocking of a link is measured; and standard deviations of noise
    that are then subtracted: in seven sessions of the second engine the result is its play, to 3 % and to 1.2 standard deviations
    of noise."""
    least_asset_turn: float = math.radians(0.3)
    """A marker frame is a candidate that is turned by more than this at rest [rad]."""
    most_dropped: float = 0.6
    """Share of poses that may be dropped: of more, something else is the matter."""
    stayed: float = 0.3
    """Share of the way within which a joint that got no command stays."""
    went: float = 0.5
    """Share of the way that the model has gone at least by then."""
    dropped_explains: float = 0.5
    """Share of a joint's gap that its dropped commands must explain."""
    dropped_explains_free: float = 0.8
    """The same where none was dropped on a fixed base: on the ground a joint may be kept from going."""
    dropped_probability: float = 0.95
    """Probability that commands were dropped where they explain that much."""
    least_step: float = math.radians(2.0)
    """A pose that moves a joint by less does not tell whether it came [rad]."""
    calm: float = 4.0
    """Standard deviations within which a joint goes as the model has it."""
    behind: float = 7.0
    """Standard deviations beyond which it stays behind."""
    before: float = 0.03
    """Time before a command that shows how the joint went until then [s]."""
    lag: float = 0.05
    """Time by which the effect of a command appears later [s]."""
    pose_explains: float = 0.8
    """Share of a joint's excess error until the next command that leaving out one pose must explain."""
    most_dropped_in_motion: float = 0.5
    """Share of poses that may be dropped in motion: of more, something else is the matter."""
    turns: int = 12
    """Poses that may be dropped one after another."""


@dataclass(frozen=True)
class FitOptions:
    """Scaled parameters, responses, fits and their covariance."""

    least_move: float = 0.3
    """Least magnitude to which a finite difference is relative, in typical sizes."""
    least_taken: float = 0.25
    """Least size, in typical ones, of a nominal constant without which the servo is simulated, too: less is not noticeable."""
    vector_move: float = 0.5
    """The same of one of a vector's numbers, in its length."""
    most_doubled: float = 1000.0
    """Doublings that a number still holds; where a bound is infinite it is the parameter's own range that ends it."""
    least_mass: float = 0.05
    """What positions of a point mass are divided by at least, in typical masses."""
    most_moment: float = 100.0
    """How far moments of a point mass go, in typical ones."""
    away: float = 2.5
    """Typical distances at which a point mass is probed, along each axis."""
    swung_distance: float = 0.08
    """From its axis, at which a mass that swings about it is looked for at first [m]."""
    swung_doublings: tuple[float, float] = (-3.0, 2.6)
    """How many doublings off that distance it may be."""
    scanned: tuple[float, ...] = (1.0, 4.0)
    """Sizes at which a candidate's response is scanned, in typical ones."""
    scanned_between: float = 2.0
    """One more, on a fixed base, for what may begin at any load, as what ends a motor's torque."""
    scanned_ground: tuple[float, ...] = (0.7, 2.0)
    """Sizes at which the floor's candidates are scanned on a walk."""
    scanned_around: float = 2.0
    """Size of several parameters on a walk, beyond its chaotic response to small changes."""
    shaped: tuple[float, ...] = (0.0, 2.0, -2.0)
    """Doublings, on a fixed base, of a parameter that only shapes an effect: a fit from a wrong start ends in a local minimum."""
    stride_fixed: float = 0.15
    """Share of a number by which it is moved for a finite difference on a fixed base."""
    stride_free: float = 0.4
    """The same on a free base, which answers small moves with noise."""
    stride_end: float = 0.08
    """The same there near the end of a fit."""
    wide: float = 0.35
    """The same where slopes led nowhere and all that was seen lies closer."""
    tiny: float = 1e-6
    """Of a number, below which a move tells nothing of slopes."""
    converged: float = 3e-3
    """A fit ends where a step takes less than this share off the sum of squares."""
    refit_steps: int = 3
    """Steps of a fit of effects that fixed-base takes identified before."""
    against: float = 100.0
    """Chi squared by which fixed-base takes must contradict a value estimated from floating-base takes."""
    least_gain: float = 150.0
    """Of chi squared on the choosing stretches that each number of an effect must bring. Of a joint filmed for twenty seconds
    that is half its noise: engines, and a robot and its model, differ by as much."""
    finer: float = 0.5
    """Time step, in search steps, for the last slopes of several parameters that floating-base takes identify: the response to
    the height of a load is smaller than the error of a coarse step."""
    finer_steps: int = 3
    """Steps of that fit."""
    overdispersion_free: float = 60.0
    """Divisor of differences of chi squared where floating-base takes identify an effect: errors of neighbouring frames are
    correlated, simulators differ, and fits of the same effect from different starting points end some hundreds apart there."""
    contact_error: float = 0.06
    """Standard deviation, as a share of a number, that contact adds where a floating-base take identifies it: engines, and
    robots, differ by that."""
    slope_step: float = 1e-3
    """Relative difference of a size, for the slope of a known function."""
    drift: float = 0.25
    """Share of a number by which it must change within a take to be a drift: two engines, or a robot and a model, differ by
    less."""
    drift_sure: float = 5.0
    """Standard errors that this change must be."""


@dataclass(frozen=True)
class ConclusionOptions:
    """From a fit to findings."""

    z90: float = 1.645
    """Half width of a 90 % interval, in standard deviations."""
    wider: float = 1.3
    """Factor on the intervals from the residuals' scatter: errors of neighbouring frames are correlated, and the recording's
    engine, or the world, is not ours. With 1.1, 88 % of 193 intervals of three trials contained the truth, with 1.3 it is 91
    %."""
    least_relative: float = 0.005
    """Least standard deviation of a parameter, as a share of its distance from neutral."""
    worth_an_experiment: float = 0.05
    """Probability from which on the likeliest rival of a finding is worth an experiment."""
    correlated: float = 0.3
    """Correlation above which a residual is attributed to a signal."""
    same_elsewhere: float = 0.1
    """Probability of the same effect elsewhere, relative to the finding's, above which that place is named with it."""
    likely: float = 0.5
    """Probability from which on a name counts as an explanation."""
    tied: float = 0.5
    """An alternative at least this share as likely as the effect ties with it: the finding is that one of the two is there."""
    surest: float = 0.98
    """Largest probability of a finding: physics outside the vocabulary can look like any effect."""
    at_its_end: float = 0.99
    """Share of how far an effect's numbers may lie from neutral, from which on it wants to go further than is plausible."""
    aside: float = math.tan(math.radians(15.0))
    """Share of a force's vertical part that it may pull aside by and still is one straight down."""


PROBLEM = ProblemOptions()
READ_OFF = ReadOffOptions()
FIT = FitOptions()
CONCLUSIONS = ConclusionOptions()
