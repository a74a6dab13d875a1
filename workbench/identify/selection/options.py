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
    """Share of what is beyond noise that responses of several numbers must explain. If they do not on all floating-base takes,
    but do on one of them, what that one says is tried: where a joint gives way early or late by chance, a walk tells nothing, and
    a calmer one may."""
    worth: float = 0.3
    worth_walking: float = 0.5
    """Share of the best gain at its place, as responses predict it, from which on an effect is fitted: where the base is fixed,
    where that is cheap, and on a walk."""
    doubted: float = 0.6
    """Share of the least gain from which on the best are fitted where none is predicted all of it: responses say too little where
    only one of the walks was looked at."""
    behind: float = 0.6
    """Share of the best gain at its place after one step of the fit, from which on an effect is fitted to its end."""
    remembered: float = 0.15
    remembered_least: float = 0.25
    """Shares of the best gain and of the least, as responses of a screening beside fewer effects predict it, from which on an
    effect is looked at: beside what came since it does something else, as a foot on soft ground carries otherwise."""
    most_fitted: int = 3
    """Effects judged by all channels that are fitted at a time, of one number and of several: those of which most is
    predicted."""
    steps: int = 3
    steps_walking: int = 2
    """Of a fit. On the ground what is ahead is fitted again in finer steps, with all that was chosen."""


@dataclass(frozen=True)
class SchedulingOptions:
    """Which candidates are evaluated first."""

    tiers: int = 8
    tiers_of_all: int = 6
    """On the ground the first are what moves the robot as a whole, and joints that stand out."""
    stands_out: float = 4.0
    """Times the next worst of what is beyond noise on a take on the ground, of chi squared, that a joint's own is from which on
    it lacks something, not the robot as a whole."""
    ill: float = 0.25
    """Joints whose gap is this share of the worst joint's are asked about."""
    few: int = 2
    """Joints that may be ill without the robot as a whole being asked about before them and, on the ground, with the body as the
    model has it, without zero offsets of others being asked about."""
    moved: float = 0.1
    """Angle [rad] beyond which a joint has moved enough to show what it lacks."""


@dataclass(frozen=True)
class SubsetOptions:
    """Best subsets of effects in one joint."""

    nearly_all: float = 0.9
    """Share of a gap from which on less likely effects are not asked for on a fixed base, as what a hand carries looks like a
    weak shoulder, nor sets of them."""
    half: float = 0.5
    """Share of what the best smaller set leaves, as responses predict it, that the best with one more effect may leave."""
    sizes: tuple[int, int] = (2, 3)
    fitted: int = 6
    as_good: float = 2.0
    """Effects in a set, and how many sets of a size are fitted: of those that leave less than `as_good` times what the best does,
    as lines predict roughly."""
    ahead: int = 2
    exchanges: int = 3
    right: float = 1.2
    """Sets that are fitted to the end; how often sets with one effect replaced are asked for; and what a set may leave, in shares
    of what a right model does, for which none is replaced."""
    again: tuple[tuple[float, float], ...] = tuple(product((0.75, 1.33), (-0.7, 0.7)))
    """Where a fit of an effect that a number shapes is begun again: shares of its size, and doublings of the shape."""
    most_steps: int = 5
    together_steps: int = 12
    """Of a fit of all effects: when one was added, and where it is begun again; when several were, where lines predict them, and
    where others must take one's place. It ends where little changes."""


@dataclass(frozen=True)
class SwapOptions:
    """One effect replaced by another."""

    fitted: int = 2
    """Others that are fitted in each one's place."""


@dataclass(frozen=True)
class ReevaluationOptions:
    """Accepted effects evaluated again."""

    near: float = 0.5
    most: int = 2
    """Share of its gain that a rival had when it was taken, and how many are fitted."""


@dataclass(frozen=True)
class RecordOptions:
    """What is said of a finished selection."""

    complete: float = 0.97
    """Share of a gap that one effect closes, from which on it is not doubted for what else is there: true effects close more."""


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
    """Of what the effects before it brought at its place, that an effect must bring on a fixed base and on the ground, and of a
    fixed-base channel's gap that counts as one again: two engines, or a robot and a model, differ by hundredths of what an effect
    does, and a second effect must not live on that."""
    alone: float = 0.25
    """Of `least_share`, for a joint on a fixed base that nothing was given to and of which much more than of any other is left:
    what engines play differently of an effect that all joints show, they do in all."""
    rough_share: float = 0.04
    left_share: float = 0.02
    """The same of a channel's gap on the ground, where engines differ more; and of all that is left there, for another round."""
    least_closed: float = 0.15
    last_closed: float = 0.5
    """Share of what is beyond noise at its place that an effect must take away when it is taken, and with all that came after: of
    several, the first may leave much to the next, but a name that leaves half at the end is not what is missing."""


@dataclass(frozen=True)
class BackwardOptions:
    """Backward elimination."""

    clearly: float = 5.0
    """Times that gain, from which on an effect is missed whatever the others do in its place."""


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
    """Of a fit of all effects when one was dropped at the end; it ends where little changes."""
    most_rivals: int = 2
    close: float = 0.15
    halfway: float = 0.5
    """Rivals that are fitted in an effect's place, and how far behind its gain they may be where all channels of a walk judge; at
    a joint, where the best leaves more than a tenth: there some fit has not come to its end."""
    alike: float = 0.25
    """Joints whose best gain is this share of the greatest, or `nearly_all` of what they lack, are taken in the same round."""


@dataclass(frozen=True)
class OddsOptions:
    """From differences of chi squared to odds."""

    temper: float = 4.0
    """Neighbouring frames err alike: what chi squared differences are divided by when they become probabilities, where
    floating-base takes do not identify it."""
    rough: float = 0.015
    """The same as a share of an effect's gain: where that is more, floating-base takes leave more open."""
    better: float = 30.0
    """Of the same: an equivalent effect that fixed-base takes find worse by this much is none; by more where the fit leaves more
    than a right model does."""
    number: float = 40.0
    number_share: float = 0.03
    """What each number that a name has more than another must bring, of the same: `temper` times the logarithm of how many frames
    speak (G. Schwarz, Annals of Statistics 6, 1978); at least this share of the effect's gain, as two engines, or a robot and a
    model, differ by some hundredths of it, and a name with more numbers makes more of that."""
    most_from_floating: float = 2 * temper
    """The most of chi squared that floating-base takes add to what fixed-base takes say of a name: odds of e to one. Small
    differences send a walk elsewhere, and a wrong name may happen to go that way."""


@dataclass(frozen=True)
class RivalOptions:
    """Which rivals are fitted in an effect's place."""

    near: float = 400.0
    near_fixed: float = 0.05
    """Of chi squared on the choosing stretches: a rival further behind at its place is not put in the effect's place; nor one
    that is this share of the effect's gain behind (`close` where a walk in coarse steps said it)."""
    steps: int = 4
    """Of a fit: names that differ by little are told apart at their best alone."""
    shape_end: float = 0.5
    """Doublings from its end at which a number that only shapes an effect hardly does so any more."""


@dataclass(frozen=True)
class ComparisonOptions:
    """Rivals in an effect's place."""

    likelier: float = 0.5
    """A rival whose lead is this share of what leads are divided by is a fourth likelier, and takes an effect's place."""
    least_equivalent: float = 1.0 / 3.0
    """The least odds of a finding's equivalent effect that floating-base takes identify, where it came near enough to be put in
    its place, and of a name that fixed-base takes find better but for the price of its numbers."""
    closed: tuple[tuple[float, float], ...] = ((0.9, 1.0), (0.75, 0.85), (0.5, 0.45))
    """Share of what was beyond noise at its place that an effect took away, and the factor on its confidence; `least` below the
    last. True effects close 97 % and more on a stand, 90 % on the ground; what the vocabulary lacks, its nearest name closes in
    part."""
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
    """Of a finding's probability, what a rival that pulls straight down has at least where a load is not told from what hangs: of
    true loads it is up to 0.4."""
    alike_floor: float = 0.15
    hardly: float = 0.5
    """By how much [a logarithm] a floor's friction has to differ from the model's, and the factor for one that differs by less:
    of robots that lack nothing, played by another engine, floating-base takes want up to 5 % more, and a mass that swings looks
    like 12 % more. The same for a number that would go further if it might, or may be nothing, and for a pull straight down: it
    makes up for something else."""
    nothing: float = 3.0
    """Standard deviations from neutral within which a number may be nothing: a mass that swings below a body looked like a load
    of 2.7, true ones come to 3.3 and more."""


SCREENING = ScreeningOptions()
SCHEDULING = SchedulingOptions()
SUBSETS = SubsetOptions()
SWAP = SwapOptions()
REEVALUATION = ReevaluationOptions()
RECORD = RecordOptions()
ACCEPTANCE = AcceptanceOptions()
BACKWARD = BackwardOptions()
PAIR_MOVE = PairOptions()
FORWARD = ForwardOptions()
ODDS = OddsOptions()
RIVAL = RivalOptions()
COMPARISON = ComparisonOptions()
CALIBRATION = CalibrationOptions()
