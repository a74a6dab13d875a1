"""Every number that the selection is run with: unit, meaning and reason, by file."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product


@dataclass(frozen=True)
class ScreeningOptions:
    """Candidates looked at before they are fitted."""

    far: float = 5.0
    far_walking: float = 1.6
    """Times the size it was looked at that an effect's response is believed to grow: a foot grips or slips, which no line
    tells."""
    calm: float = 0.5
    """Share of the excess error that responses of several parameters must explain. If they explain it not on all floating-base
    takes together but on one of them, that take alone is used: where a joint gives way early or late by chance, one walk may
    show nothing where a calmer one does."""
    worth: float = 0.3
    worth_walking: float = 0.5
    """Share of the best gain at the same joint or link, as predicted by responses, above which an effect is fitted: where the
    base is fixed, where that is cheap, and on a walk."""
    doubted: float = 0.6
    """Share of the least gain from which on the best are fitted where none is predicted all of it: responses say too little where
    only one of the walks was looked at."""
    behind: float = 0.6
    """Share of the best gain at the same joint or link after one step of the fit, above which an effect is fitted to the end."""
    remembered: float = 0.15
    remembered_least: float = 0.25
    """Shares of the best gain and of the least, as responses of a screening beside fewer effects predict it, from which on an
    effect is looked at: beside what came since it does something else, as a foot on soft ground carries otherwise."""
    most_fitted: int = 3
    """Effects judged by all channels that are fitted at a time, of one number and of several: those of which most is
    predicted."""
    steps: int = 3
    steps_walking: int = 2
    """Steps of a fit. On the ground the leading candidate is fitted again at a finer time step, with all accepted effects."""


@dataclass(frozen=True)
class SchedulingOptions:
    """Which candidates are evaluated first."""

    tiers: int = 8
    tiers_of_all: int = 6
    """On the ground, effects of the whole robot and joints that stand out come first."""
    stands_out: float = 4.0
    """Ratio of a joint's excess chi squared to the next largest, on a take on the ground, above which the joint is taken to have
    an error of its own, rather than the whole robot."""
    ill: float = 0.25
    """Joints whose gap is this share of the worst joint's are asked about."""
    few: int = 2
    """Joints that may be ill without the robot as a whole being asked about before them and, on the ground, with the body as the
    model has it, without zero offsets of others being asked about."""
    moved: float = 0.1
    """Angle [rad] beyond which a joint has moved enough to show its errors."""


@dataclass(frozen=True)
class SubsetOptions:
    """Best subsets of effects in one joint."""

    nearly_all: float = 0.9
    """Share of a gap above which less likely effects, and sets of effects, are not tried on a fixed base: a load in the hand
    looks like a weak shoulder."""
    half: float = 0.5
    """Residual of the best set with one more effect, as predicted by responses, relative to the best smaller set, to be tried."""
    sizes: tuple[int, int] = (2, 3)
    fitted: int = 6
    as_good: float = 2.0
    """Effects in a set, and how many sets of a size are fitted: those whose predicted residual is less than `as_good` times the
    best, since linear prediction is rough."""
    ahead: int = 2
    exchanges: int = 3
    exchanged: int = 2
    right: float = 1.2
    """Sets that are fitted to the end; how often sets with one effect replaced are tried, with how many others in each one's
    place; and the residual of a set, relative to a correct model, at which no effect is replaced."""
    again: tuple[tuple[float, float], ...] = tuple(product((0.75, 1.33), (-0.7, 0.7)))
    """Where a fit of an effect that a number shapes is begun again: shares of its size, and doublings of the shape."""
    most_steps: int = 5
    together_steps: int = 12
    """Steps of a fit of the whole model: when one was added, and where it is restarted; when several were added from linear
    predictions; and when others must compensate for a removed one. It ends when little changes."""


@dataclass(frozen=True)
class ReconsiderOptions:
    """Accepted effects reconsidered."""

    near: float = 0.5
    most: int = 2
    """Share of its gain that a rival had when an effect was taken, from which on it is fitted in its place, and how many are."""
    complete: float = 0.97
    """Share of a gap that one effect closes, from which on it is not doubted for what else is there: true effects close more."""
    clearly: float = 5.0
    """Multiple of the gain required of an effect above which it is missing regardless of how well the others can compensate for
    it."""


@dataclass(frozen=True)
class AcceptanceOptions:
    """The stopping criterion and the acceptance test."""

    least_walking: float = 300.0
    """`FIT.least_gain` of an effect that only floating-base takes show, whatever its numbers are: contact makes more of small
    differences."""
    all_closed: float = 0.5
    """Share of `FIT.least_gain` that is enough of what closes all of a joint's gap: it is small, and its shape is right."""
    least_share: float = 0.01
    walking_share: float = 0.02
    """Share of the gain of earlier effects at the same joint or link that a further effect must gain, on a fixed base and on the
    ground, and share of a fixed-base channel's gap that counts as a new gap: two simulators, or a robot and a model, differ by
    some hundredths of an effect's response, and a second effect must not be based on that."""
    alone: float = 0.25
    """Multiple of `least_share` for a joint on a fixed base without an effect and with a much larger residual than any other:
    where simulators differ in an effect that all joints show, they differ in every joint."""
    rough_share: float = 0.04
    left_share: float = 0.02
    """The same share of a channel's gap on the ground, where simulators differ more; and of the total residual there, for
    another round."""
    least_closed: float = 0.15
    last_closed: float = 0.5
    """Share of the excess error at its joint or link that an effect must remove when it is accepted, and together with later
    ones: the first of several may leave much to the next, but an effect that still leaves half at the end is not the cause."""


@dataclass(frozen=True)
class PairOptions:
    """One effect replaced by two."""

    near: float = 0.3
    ones: int = 3
    pairs: int = 3
    steps: int = 5
    """Share of the best one's gain from which on another is given company; how many are, how many pairs are fitted, and steps of
    that."""


@dataclass(frozen=True)
class ForwardOptions:
    """The forward selection."""

    most_rounds: int = 6
    """On a fixed base, and on the ground: an arm may lack several things in each joint, a round finds one in each."""
    most_work: float = 3200.0
    most_rollouts: float = 60.0
    """Seconds of rollouts, and rollouts of all takes if that is more, after
    which nothing more is tried: minutes, of half a minute of recording."""
    enough: float = 0.6
    """Share of a gap from which on less likely effects are not asked for. On a fixed base it is `nearly_all`, and on the ground
    before joints are asked, as a joint's effect can look like one of the whole robot's."""
    own_gap: float = 0.9
    """The same of a joint that stands out: on a body that goes otherwise a tail swings otherwise; play closes three quarters."""
    nearly_all_walking: float = 0.97
    """`nearly_all` where all channels of a walk judge: where one foot stands otherwise the robot turns, and much else makes it
    turn back, which closes up to 0.93; true effects close more."""
    replayed_steps: int = 4
    """Of a fit to takes that are played otherwise."""
    last_steps: int = 3
    """Steps of a fit of the whole model after one was dropped at the end; it ends when little changes."""
    most_rivals: int = 2
    close: float = 0.15
    halfway: float = 0.5
    """Rivals that are fitted in an effect's place, and how far behind its gain they may be where all channels of a walk judge; at
    a joint, where the best leaves more than a tenth: there some fit has not come to its end."""
    alike: float = 0.25
    """Joints whose best gain is this share of the largest, or `nearly_all` of their excess error, are accepted in the same
    round."""


@dataclass(frozen=True)
class OddsOptions:
    """From differences of chi squared to odds."""

    temper: float = 4.0
    """Errors of neighbouring frames are correlated: divisor of chi squared differences when they become probabilities, where
    floating-base takes do not identify the effect."""
    rough: float = 0.015
    """The same as a share of an effect's gain: where that is more, floating-base takes leave more open."""
    better: float = 30.0
    """Of the same: an equivalent effect that fixed-base takes find worse by this much is none; by more where the fit leaves more
    than a right model does."""
    number: float = 40.0
    number_share: float = 0.03
    """Gain required for each additional parameter: `temper` times the logarithm of the number of frames (G. Schwarz, Annals of
    Statistics 6, 1978), and at least this share of the effect's gain, since two simulators, or a robot and a model, differ by
    some hundredths of it, and an effect with more parameters fits more of that."""
    most_from_floating: float = 2 * temper
    """The most of chi squared that floating-base takes add to what fixed-base takes say of a name: odds of e to one. Small
    differences send a walk elsewhere, and a wrong name may happen to go that way."""


@dataclass(frozen=True)
class ComparisonOptions:
    """Rivals in an effect's place: which are fitted there, and what their odds are."""

    near: float = 400.0
    near_fixed: float = 0.05
    """Deficit in chi squared on the choosing stretches beyond which a rival at the same joint or link is not tried as a
    replacement; nor is one with a deficit of this share of the effect's gain (`close` for a walk at coarse steps)."""
    steps: int = 4
    """Of a fit: names that differ by little are told apart at their best alone."""
    shape_end: float = 0.5
    """Doublings from its end at which a number that only shapes an effect hardly does so any more."""
    likelier: float = 0.5
    """A rival whose lead is this share of what leads are divided by is a fourth likelier, and takes an effect's place."""
    least_equivalent: float = 1.0 / 3.0
    """The least odds of a finding's equivalent effect that floating-base takes identify, where it came near enough to be put in
    its place, and of a name that fixed-base takes find better but for the price of its numbers."""
    closed: tuple[tuple[float, float], ...] = ((0.9, 1.0), (0.75, 0.85), (0.5, 0.45))
    """Share of the excess error at its joint or link that an effect removed, and the factor on its confidence; `least` below the
    last. True effects remove 97 % and more on a stand, 90 % on the ground; out-of-vocabulary physics is removed only in part by
    the nearest available effect."""
    least: float = 0.2


@dataclass(frozen=True)
class CalibrationOptions:
    """How sure an effect is, beyond its odds."""

    left: tuple[tuple[float, float], ...] = ((1.5, 1.0), (2.5, 0.7), (6.0, 0.4))
    """RMS over sigma that fixed-base takes leave in some channel there at the end, and the factor for that; `least` beyond the
    last. A large gap may be closed by 97 % and still leave ten times the noise: something else acts there."""
    rattles: float = 0.7
    """At least that factor for a link that cameras saw rock across its servo's axis: which way it lies is chance, each moment as
    far from a right model as it has play."""
    changing: float = 0.5
    """The factor for an effect whose numbers would have to change within a take: something else that does so looks like it."""
    about_as_likely: float = 0.5
    """Least probability of a purely vertical pull as a rival, relative to the finding's, where a load cannot be separated from a
    hanging mass: for true loads it is up to 0.4."""
    alike_floor: float = 0.15
    hardly: float = 0.5
    """Difference [of the logarithm] between the floor's friction and the model's, and the factor for a smaller difference: for
    robots without any effect, simulated by another engine, floating-base takes ask for up to 5 % more, and a mass that swings
    looks like 12 % more. The same for a parameter at its bound, or close to zero, and for a purely vertical pull: it compensates
    for something else."""
    nothing: float = 3.0
    """Standard deviations from neutral within which a parameter may be zero: a mass that swings below a body looked like a load
    at 2.7, true ones are at 3.3 and more."""


SCREENING = ScreeningOptions()
SCHEDULING = SchedulingOptions()
SUBSETS = SubsetOptions()
RECONSIDER = ReconsiderOptions()
ACCEPTANCE = AcceptanceOptions()
PAIR_MOVE = PairOptions()
FORWARD = ForwardOptions()
ODDS = OddsOptions()
COMPARISON = ComparisonOptions()
CALIBRATION = CalibrationOptions()
