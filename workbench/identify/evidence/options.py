"""Every number of the evidence's search, in one typed place."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace


@dataclass(frozen=True)
class SinceThen:
    """How much a robot that was diagnosed before may have changed since, with nothing to report: standard deviations of the
    logarithm, `zero` [rad].

    torque, back-EMF: one STS3215 differed by 3 to 6 % per duty between days at 28, 34 and 37 deg C. friction: grease and wear,
    20 to 40 % there. law: firmware does not drift, but the way logs are stamped may. zero: a link removed and mounted again."""

    torque: float = 0.06
    friction: float = 0.3
    law: float = 0.02
    zero: float = math.radians(0.3)

    def of(self, name: str) -> float:
        """Standard deviation of a number's change."""
        own = {"torque_at_full_duty": self.torque, "back_emf": self.torque, "zero": self.zero} | dict.fromkeys(
            ("coulomb_friction", "viscous_friction", "load_friction"), self.friction)
        return own.get(name, self.law)


@dataclass(frozen=True)
class LawOptions:
    """The repeatable torque that no effect describes, which competes with the effects.

    shares: standard deviations of the basis weights that are tried, as shares of the servo's torque at full duty; from barely
    visible in a log to felt by hand, in factors of three, as finely as a log determines such a size. of_angle, of_duty,
    of_speed: numbers of basis functions; about one for every 10 degrees of a usual motion, and at most ten where friction and
    motor are smooth. knots: table rows for each function. covered: quantiles of the motion that the functions span. slow [rad/s]:
    functions of speed are spaced evenly below it and by the logarithm above. least_travel [rad]: a joint that moves less cannot
    show such a torque. iterations: of a fit; shares_of_step: fractions of its step that are tried. behind [nats]: a law predicted
    to be this far behind the most probable model is not fitted. reweighted: rounds in which Student's weights converge. probe:
    step of a weight for finite differences, as a share of the torque at full duty: it has to exceed the dry friction of a joint
    near rest, which would hide the response to smaller steps.
    """

    shares: tuple[float, ...] = (0.003, 0.01, 0.03, 0.1)
    of_angle: int = 14
    of_duty: int = 6
    of_speed: int = 9
    knots: int = 4
    covered: tuple[float, float] = (0.01, 0.99)
    slow: float = 0.3
    least_travel: float = 0.02
    iterations: int = 3
    shares_of_step: tuple[float, ...] = (1.0, 0.5, 0.2)
    behind: float = 7.0
    reweighted: int = 3
    probe: float = 0.02


@dataclass(frozen=True)
class RangeOptions:
    """How fast a joint moves in recordings. seldom: quantile of the magnitudes, so that a single bad reading is none of them.
    smoothed [s]: over which angles are smoothed before they are differentiated twice: several readings, and less than a servo's
    move; fewest: least number of rows for that."""

    seldom: float = 0.99
    smoothed: float = 0.1
    fewest: int = 7


@dataclass(frozen=True)
class EvidenceOptions:
    """Defaults hold for all robots; none was set on a session.

    The likelihood. tails: degrees of freedom of Student's t, so that a few events (an arm that sticks) do not decide; 4 is the
    usual choice for robust regression (K. Lange et al., JASA 84, 1989). least_discrepancy, most_discrepancy [rad]: bounds of the
    model's own discrepancy, from a tenth of a servo's count to a lost arm.

    The priors. width: Cauchy scale of effect sizes, in typical sizes (A. Gelman et al., Ann. Appl. Stat. 2, 2008: a weak prior
    with heavy tails). freedom: degrees of freedom of Student's t for sizes with a known 99 % point, the value that one servo in a
    hundred exceeds: 12 deg of play cost nine nats more than 1 deg if that point is 4 deg. sheet: standard deviation of the
    logarithm of torque at full duty and of back-EMF from a data sheet; on one weighed servo (STS3215, 12 V) they are 2.5 and 1.9
    times the sheet's. doublings: standard deviation, in factors of two, of a parameter that only shapes an effect. expected:
    number of effects expected at one joint's servo, shared among all names that are tried; it corrects for searching many.

    The search. explored [s]: longest correlation time used while exploring, about one stick or slip, because residuals of poor
    models stay correlated for longer. horizon [s]: length of the windows for exploring, each from the recorded state: several
    times a servo's settling time, but shorter than the seconds over which stick and slip separate nearly equal models. grown:
    whole logs judge only if their discrepancy is at most this multiple of the windows'. far: largest recalibration of a number of
    the nominal law, in standard deviations; its prior prices it. stride: step of finite differences, in prior standard deviations
    or typical sizes; stick and slip answer smaller steps with noise. spread: the same for the simultaneous moves of the last
    slopes, half a prior standard deviation. iterations: most steps of a fit. starts: starting points of the plain fit: through
    stick and slip, fits of one model end up to 20 nats apart, and an effect would win only for lack of a better plain fit. sizes:
    shares of the typical sizes from which the best models are fitted again, for the same reason, and those that differ from them
    in one effect of the same kind. hopeless [nats]: such a fit this far behind the best after its first steps is not continued;
    fits of one model from different starts were up to 50 nats apart. beam: states that are extended, and single-effect moves
    fitted for each; refined: fitted moves of one or two effects, led of them sharing their first effect; paired: best moves that
    are also predicted in pairs. most: effects of one joint. seconds: of all takes together that the search uses, from their
    beginnings; finished: of all takes together that the last fit uses, twice as long, as its rollouts have a finer step.
    most_work [s]: of a puppy's rollouts at the search's step (`RolloutEvaluator.work`), after which a search that is not thorough
    stops: about an hour of one processor, several times the cost of twelve servo logs.

    drift: how much a robot that was diagnosed before may have changed; None: the nominal robot is as designed. motion: how a
    joint's range of motion is measured. faster: where a joint moves this many times faster than that diagnosis saw it, what its
    servo does there may have been so before; changed: the probability that it is a change then: even odds, as nothing speaks for
    either. formal: factor on the formal standard deviations of a servo's law, because differences through stick and slip
    understate them, by 2 to 8 on three weighed rigs. law: the torque that no effect describes.

    The posterior. occam [nats]: models this far behind the best no longer count (D. Madigan and A. Raftery, JASA 89, 1994: a
    factor of twenty, here of a thousand, as fits end some nats apart). veto [nats]: an effect is rejected where unseen takes are
    less likely with it by this much, odds of twenty. similarity: an effect is tied to torque if scaling every torque reproduces
    at least this share of its response. apart: gravity over torque is reported where it is this many standard deviations
    off nominal, its variation between days included. sure: standard errors by which a servo's own register must contradict an
    effect, and refuted: the share of the effect's typical size that is then ruled out, which no recording would show.
    """

    tails: float = 4.0
    least_discrepancy: float = 1.5e-4
    most_discrepancy: float = 0.3
    width: float = 3.0
    sheet: float = 0.5
    freedom: float = 4.0
    doublings: float = 2.0
    expected: float = 2.0
    stride: float = 0.15
    spread: float = 0.5
    iterations: int = 5
    starts: int = 4
    sizes: tuple[float, ...] = (0.5, 1.0, 2.0)
    hopeless: float = 70.0
    beam: int = 3
    refined: int = 9
    led: int = 2
    paired: int = 10
    most: int = 6
    explored: float = 0.15
    horizon: float = 0.5
    grown: float = 1.5
    far: float = 3.0
    seconds: float = 100.0
    finished: float = 200.0
    most_work: float = 2e6
    occam: float = 7.0
    veto: float = 3.0
    similarity: float = 0.5
    apart: float = 2.0
    drift: SinceThen | None = None
    motion: RangeOptions = field(default_factory=RangeOptions)
    faster: float = 1.5
    changed: float = 0.5
    formal: float = 3.0
    law: LawOptions = field(default_factory=LawOptions)
    sure: float = 3.0
    refuted: float = 0.3

    def without_names(self) -> EvidenceOptions:
        """For servo logs without a gap: the law is calibrated, and no effect is searched for."""
        return replace(self, most=0)

    @classmethod
    def since(cls) -> EvidenceOptions:
        """For a robot that was diagnosed before: with a known law few models come close to the best, and a narrower search finds
        them."""
        return cls(drift=SinceThen(), beam=2, refined=4, paired=6)


@dataclass(frozen=True)
class EvidenceNumerics:
    """How far the search's arithmetic is driven, which costs time and decides no name.

    fine: step of the last fits, in steps of the search. rounds: limit of rounds in which implausible or refuted effects are
    removed, and in which effects of the whole robot are searched alongside those of single joints. settled: relative accuracy of
    a discrepancy's size; a hundred samples determine it to a twentieth. window: correlation times over which an autocorrelation
    is summed (Sokal). gain [nats]: a fit of all joints ends when a step gains less; shares: fractions of a step that are tried.
    first: an effect of the whole robot goes first if it explains at least this share of the gain of the best effects of all
    joints; the complete search of both decides between them. splits: ways that are tried to split a constant between its
    recalibration and an effect, a two-hundredth of a standard deviation apart. """

    fine: float = 0.5
    rounds: int = 4
    settled: float = 0.02
    window: float = 5.0
    gain: float = 0.1
    shares: tuple[float, ...] = (1.0, 0.5, 0.25)
    first: float = 0.5
    splits: int = 1201


NUMERICS = EvidenceNumerics()
