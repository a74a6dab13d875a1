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
    """A repeatable torque that nobody has named, beside the effects.

    shares: standard deviations of its weights that are tried, as shares of the servo's torque at full duty: from a torque that a
    log barely shows to one that is felt by hand, a factor of three apart, about what a log tells of such a size. of_angle,
    of_duty, of_speed: how many functions cover what a joint did: about every 10 degrees of a usual motion, at most ten for what
    friction and motor do smoothly. knots: rows of a table for each function. covered: quantiles of the motion between which
    functions lie. slow [rad/s]: below it speeds are covered evenly, above it by their logarithm. least_travel [rad]: of a joint
    that could show such a torque. iterations: of a fit; shares_of_step: of its steps that are tried. behind [nats]: a law
    predicted this far behind the likeliest model is not fitted. reweighted: rounds in which Student's
    weights settle. probe: change of a weight that tells its slope, as a share of the torque at full duty: above what dry friction
    holds at a joint that is nearly at rest, which would answer smaller ones with nothing.
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
class EvidenceOptions:
    """Defaults hold for all robots; none was set on a session.

    The likelihood. tails: degrees of freedom of Student's t, so that a few events (an arm that sticks) do not decide; 4 is the
    usual choice for robust regression (K. Lange et al., JASA 84, 1989). least_discrepancy, most_discrepancy [rad]: between them
    its size is looked for, from a tenth of a servo's count to a lost arm.

    The priors. width: Cauchy scale of an effect's sizes, in typical ones (A. Gelman et al., Ann. Appl. Stat. 2, 2008: a weak
    prior with heavy tails); freedom: degrees of freedom of Student's t of a size of which an effect says what one servo in a
    hundred passes, with that as its 99 % point: 12 deg of play then cost nine nats more than 1 deg, where 4 are passed by one in
    a hundred; sheet: standard deviation of the logarithm of torque at full duty and of back-EMF that a data sheet says: of one
    servo that was weighed against (STS3215, 12 V) they are 2.5 and 1.9 times that; doublings: standard deviation of a number that
    only shapes an effect, a factor of four either way. expected: effects that one joint's servo is thought to lack, spread over
    all names that are tried; it pays for having searched many.

    The search. explored [s]: the longest correlation that counts while it explores, about a stick or a slip, as what poor models
    leave is correlated for longer. horizon [s]: of the windows, each from the recorded state, by which it explores: several times
    as long as a servo takes to a goal, short of the seconds over which stick and slip part models that are alike. grown: times
    the discrepancy over windows up to which that over whole logs may be, for these to judge. far: standard deviations that a
    number of the nominal law may be recalibrated by; its prior prices them. stride: of differences, in standard deviations of the
    prior or typical sizes: stick and slip answers smaller ones with noise; spread: of the moves that tell the last slopes,
    likewise: half of what was known before. iterations: most steps of a fit. starts: of the plain fit: through stick and slip,
    fits of one model end up to 20 nats apart, and an effect would win for want of a better plain fit. beam: states that are
    extended, and moves of one effect that are fitted of each; refined: moves of one or two that are, led of these by the same
    one; paired: of the best moves, those that are also predicted two at a time. most: effects of one joint. seconds: of all takes
    together that the search looks at, their beginnings; the last fit sees all. most_work [s]: of a puppy's rollouts at the
    search's step (`RolloutEvaluator.work`), after which nothing more is tried unless the search is to be thorough: about an hour
    of a processor, several times what twelve logs of a servo need.

    drift: where the nominal robot is one that was diagnosed before, what may have changed since; None: it is one as drawn.
    formal: how many times its formal standard deviations a servo's law is off: differences through stick and slip claim to know
    more than they do, by a factor of 2 to 8 on three weighed rigs. A diagnosis writes down its law with errors so much larger.
    law: the torque that nobody has named, beside the effects.

    The posterior. occam [nats]: models this far behind the best no longer count (D. Madigan and A. Raftery, JASA 89, 1994: a
    factor of twenty, here of a thousand, as fits end some nats apart). veto [nats]: an effect is rejected where unseen takes are
    less likely with it by this much, odds of twenty. alike: an effect is tied to torque if a change of all torques does at least
    this share of the same. apart: gravity over torque is reported where it differs from the nominal by so many standard
    deviations, its variation between days included. sure: standard errors by which a servo's own register must refute a name, and
    refuted: the share of an effect's typical size that it then rules out, which no recording would show.
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
    most_work: float = 2e6
    occam: float = 7.0
    veto: float = 3.0
    alike: float = 0.5
    apart: float = 2.0
    drift: SinceThen | None = None
    formal: float = 3.0
    law: LawOptions = field(default_factory=LawOptions)
    sure: float = 3.0
    refuted: float = 0.3

    def without_names(self) -> EvidenceOptions:
        """For servo logs without a gap: the law is calibrated, and no effect is looked for."""
        return replace(self, most=0)

    @classmethod
    def since(cls) -> EvidenceOptions:
        """Of a robot that was diagnosed before: as its law is known, few models come close to the best, and a narrower search
        finds them."""
        return cls(drift=SinceThen(), beam=2, refined=4, paired=6)


@dataclass(frozen=True)
class EvidenceNumerics:
    """How far the search's arithmetic is driven, which costs time and decides no name.

    fine: step of the last fits, in steps of the search. rounds: most times that effects are taken out by what is plausible, by
    what they are known to or by takes kept back, and that effects of the whole robot are looked for beside what the joints have.
    settled: share to which a discrepancy's size is found; a hundred samples tell it to a twentieth. gain [nats]: of a step of a
    fit of all joints below which it ends; shares: of a step that are tried. first: share of what the best effects of all joints
    explain from which one of the whole robot goes first; which of both it is, is seen when each was searched to its end.
    """

    fine: float = 0.5
    rounds: int = 4
    settled: float = 0.02
    gain: float = 0.1
    shares: tuple[float, ...] = (1.0, 0.5, 0.25)
    first: float = 0.5


NUMERICS = EvidenceNumerics()
