"""Screening of effects: the course of one group through it, as a generator that requests rollouts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.fitting.levenberg_marquardt import Asks, Solved, fit_blocks
from workbench.identify.fitting.lockstep import through
from workbench.identify.fitting.responses import Part, ResponseBank, linearised_estimate, scan, scan_sizes
from workbench.identify.options import FIT, PROBLEM
from workbench.identify.parameters import Candidate, with_effects
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest, take_of
from workbench.identify.selection.options import SCREENING
from workbench.identify.selection.record import CandidateFit
from workbench.robot import RobotModel
from workbench.types import Array

Asking = Part[list[CandidateFit]]


@dataclass(frozen=True)
class Race:
    """Best gains so far, per joint, shared by candidates that are screened together: predicted by the responses of an earlier
    screening, predicted by the current ones, and achieved by a first step. wide: predicted gain of each candidate that is judged
    by every channel, with one parameter, at coarse steps, and with several; least: gain that must be predicted for a candidate to
    be fitted; no_fixed_base: whether no take had a fixed base, so that only floating-base takes constrain the joints."""

    remembered: dict[str | None, float] = field(default_factory=dict)
    predicted: dict[str | None, float] = field(default_factory=dict)
    reached: dict[str | None, float] = field(default_factory=dict)
    wide: dict[bool, list[float]] = field(default_factory=dict)
    least: float = 0.0
    no_fixed_base: bool = False


def note_best(best: dict[str | None, float], joints: Sequence[str | None], gains: Sequence[float]) -> None:
    """Keeps the largest gain for each joint."""
    for j, gain in zip(joints, gains):
        best[j] = max(best.get(j, 0.0), gain)


def best_at(best: dict[str | None, float], joint: str | None) -> float:
    """The best at a joint; over all joints for effects of the whole robot (None)."""
    return max(best.values()) if joint is None else best[joint]


def fit_groups(search: Search, current: Fit, groups: Sequence[Sequence[Candidate]], takes: Mapping[int, tuple[int, ...]],
               report: Callable[[float], None], ahead: float = 0.0, least: float = 0.0) -> list[CandidateFit]:
    """Every group fitted in addition to `current`, all in lockstep. A group is one candidate, or, while the base is fixed, one
    effect at several joints, each judged by its own joint's channels.

    takes: indices of the takes on which each group is fitted. ahead: largest gain on fitted stretches of rivals tried before, for
    candidates judged by all channels. least: gain that responses must predict of a candidate that is fitted.
    """
    race, asking = Race({None: ahead}, {None: ahead}, {None: ahead}, least=least, no_fixed_base=not search.fixed_base), []
    for n, group in enumerate(groups):
        base = {i: current.residuals[i] for i in takes[n]}
        apart = search.apart(group[0], takes[n])
        asking.append(CandidateEvaluation(
            search.evaluator, search.nominal, current.sizes(), base, group, race, apart, search.responses).run())
    return [trial for trials in search.side_by_side(asking, report) for trial in trials]


def _barrier() -> Part[None]:
    """Requests nothing, and continues when every group that runs in lockstep has come this far."""
    yield []


class CandidateEvaluation:
    """The course of one group through the screening: simulated, extrapolated, first step, fitted while it is not behind, judged.

    A group is one candidate, or one effect at several joints at once, each judged by its own joint's channels.
    beside, base: accepted effects with their sizes, and their residuals by take. race: gains of all groups, to which this one's
    are added. apart: whether each candidate is judged by its own joint's channels. responses: of earlier screenings, to which
    this one's are added.
    """

    def __init__(self, evaluator: RolloutEvaluator, nominal: RobotModel, beside: Sequence[tuple[Candidate, Array]],
                 base: dict[int, Array], group: Sequence[Candidate], race: Race, apart: bool, responses: ResponseBank) -> None:
        self.evaluator, self.group, self.race, self.responses = evaluator, group, race, responses
        self.with_these = with_effects(nominal, beside)
        self.joints = [c.joint if apart else None for c in group]
        self.walking = evaluator.any_floating(tuple(base))
        self.base, self.takes = base, tuple(base)
        self.coarse = all(c.size < 2 for c in group)  # several numbers are told apart by little
        self.r0 = self._vectors_by_joint(base)
        self.power = {i: evaluator.cost({i: r}, "fit") for i, r in base.items()}
        alone = self.coarse and self.walking  # floating-base takes are expensive
        self.looked_at = (max(base, key=lambda i: self.power[i]),) if alone else self.takes
        self.without: dict[int, Array] = {}
        self._name = (*(c.key for c in group), self.looked_at)

    def run(self) -> Asking:
        """Trials of every candidate in the group."""
        past = yield from self._recall()
        starts, gains = past or (yield from self._probe())
        alive = [] if past else (yield from self._worth_fitting(gains))
        out = [CandidateFit(c, x, dict.fromkeys(("fit", "choose"), min(g, 0.0)), j, True, (g, self._best(j)))
               for b, (c, x, g, j) in enumerate(zip(self.group, starts, gains, self.joints)) if b not in alive]
        if not alive:
            return out
        steps = SCREENING.steps_walking if self.walking else SCREENING.steps
        sizes = yield from self._fit([starts[b] for b in alive], alive, steps)
        finely = self.coarse and self.walking  # coarse steps say where to go, not what a walk makes of small differences
        question = self._question(alive, sizes)
        (final,) = yield [replace(question, step=1.0) if finely else question]
        final = final if finely else self._fine_residuals(final)
        return out + [self._judge(b, x, final) for b, x in zip(alive, sizes)]

    def _recall(self) -> Part[tuple[list[Array], list[float]] | None]:
        """Sizes and gains predicted by responses of an earlier screening, where these leave no hope; None: to be simulated."""
        known = self.responses.get(self._name) if self.walking else None
        guesses = None if known is None else self._initial_sizes(*known)
        if guesses is not None:
            note_best(self.race.remembered, self.joints, guesses[1])
        yield from _barrier()  # every group has noted what it remembers
        enough = max(SCREENING.remembered_least * self.race.least, SCREENING.remembered * best_at(self.race.remembered, None))
        return None if guesses is None or guesses[1][0] >= enough else guesses

    def _probe(self) -> Part[tuple[list[Array], list[float]]]:
        """Sizes to start from and what responses say they gain, from coarse rollouts."""
        everyone = list(range(len(self.group)))
        c = self.group[0]
        probes = scan(c, scan_sizes(c, self.walking, self.race.no_fixed_base), self.walking)
        looks = [self._question([], []), *(self._question(everyone, [p] * len(everyone)) for p in probes)]
        plain, *answers = yield [replace(q, takes=self.looked_at, step=PROBLEM.coarse) for q in looks]
        before = self._vectors_by_joint(plain)
        responses = [[v - w for v, w in zip(self._vectors_by_joint(a), before)] for a in answers]
        self.responses[self._name] = probes, responses
        guess = self._initial_sizes(probes, responses)
        calm = None if self.coarse or not self.walking else self._calmest(probes, responses, guess[1][0])
        if calm is None:
            return guess
        x = yield from self._fit_on(*calm)
        (answer,) = yield [self._question([0], [x])]
        return max(guess, ([x], [sum(self.power.values()) - self.evaluator.cost(answer, "fit")]), key=lambda t: t[1])

    def _fit_on(self, take: int, x: Array) -> Part[Array]:
        """Sizes fitted to one take alone, from initial sizes x."""
        def ask(point: Sequence[Array]) -> RolloutRequest:
            return replace(self._question([0], point), takes=(take,))

        def as_vectors(answer: dict[int, Array]) -> list[Array]:
            return [self.evaluator.vector(answer, "fit")]

        (answer,) = yield [ask([x])]
        (solved,) = yield from through(self._stepping([x], as_vectors(answer), [0], SCREENING.steps_walking), ask, as_vectors)
        return solved.x

    def _calmest(self, probes: Sequence[Array], responses: Sequence[Sequence[Array]], gain: float) -> tuple[int, Array] | None:
        """The take of which responses explain most, and sizes fitted to it; None where no take, or all takes together (`gain`),
        are explained well enough."""
        beyond = {i: self.power[i] - self.evaluator.expected_cost((i,), "fit") for i in self.takes}
        if gain > SCREENING.calm * sum(beyond.values()):
            return None
        take = take_of(self.evaluator.stretches(self.takes))
        best: tuple[int, Array] | None = None
        most = SCREENING.calm
        for i in self.takes:
            here = take == i
            r0 = self.r0[0][here]
            x, gain = linearised_estimate(self.group[0], r0, probes, [r0 + s[0][here] for s in responses], SCREENING.far_walking)
            share = gain / max(beyond[i], self.race.least, 1.0)
            if share > most:
                best, most = (i, x), share
        return best

    def _initial_sizes(self, probes: Sequence[Array], responses: Sequence[Sequence[Array]]) -> tuple[list[Array], list[float]]:
        """Initial sizes and their predicted gain, on all takes and on those that were simulated."""
        looked_at = {i: self.base[i] for i in self.looked_at}
        r0 = self._vectors_by_joint(looked_at)
        far = SCREENING.far_walking if self.walking else SCREENING.far
        guesses = [
            linearised_estimate(c, r0[b], probes, [r0[b] + s[b] for s in responses], far) for b, c in enumerate(self.group)
        ]
        share = max(self.evaluator.cost(looked_at, "fit"), 1e-9) / max(sum(self.power.values()), 1e-9)
        return [g[0] for g in guesses], [g[1] / share for g in guesses]

    def _best(self, joint: str | None) -> float:
        """The largest gain that responses predict at a joint, or anywhere (None)."""
        seen = (self.race.predicted, self.race.remembered)
        return max(max(of.values(), default=0.0) if joint is None else of.get(joint, 0.0) for of in seen)

    def _worth_fitting(self, gains: Sequence[float]) -> Part[list[int]]:
        """Indices of the candidates of the group that are not predicted to be far behind a rival."""
        race = self.race
        alike = race.wide.setdefault(self.coarse, [])
        alike.extend(g for j, g in zip(self.joints, gains) if j is None)
        note_best(race.predicted, self.joints, gains)
        yield from _barrier()  # every group has noted what it predicts
        last = sorted(alike, reverse=True)[:SCREENING.most_fitted][-1] if alike else 0.0
        worth = SCREENING.worth_walking if self.walking else SCREENING.worth
        least = race.least * (1.0 if best_at(race.predicted, None) > race.least else SCREENING.doubted)
        return [b for b, (j, g) in enumerate(zip(self.joints, gains))
                if g > least and g >= worth * best_at(race.predicted, j) and (j is not None or g >= last)]

    def _fit(self, starts: list[Array], alive: list[int], iterations: int) -> Part[list[Array]]:
        """Sizes after one step, and after all steps where the group is not behind by then."""
        self.without, answer = yield [self._question([], []), self._question(alive, starts)]
        first = self._vectors_by_joint(self._fine_residuals(answer))

        def improve(start: list[Array], leaves: list[Array], n: int, since: Sequence[Solved] = ()) -> Part[list[Solved]]:
            return (yield from through(self._stepping(start, leaves, alive, n, since), lambda p: self._question(alive, p),
                                       lambda answer: [self._vectors_by_joint(self._fine_residuals(answer))[b] for b in alive]))

        solved = yield from improve(starts, [first[b] for b in alive], 1)
        gains = [float(self.r0[b] @ self.r0[b]) - s.cost for b, s in zip(alive, solved)]
        note_best(self.race.reached, [self.joints[b] for b in alive], gains)
        yield from _barrier()  # every group has noted what it reached
        ahead = [g > SCREENING.behind * best_at(self.race.reached, self.joints[b]) for b, g in zip(alive, gains)]
        if iterations > 1 and any(ahead):
            solved = yield from improve([s.x for s in solved], [s.r for s in solved], iterations - 1, solved)
        return [s.x for s in solved]

    def _stepping(self, start: list[Array], leaves: list[Array], which: Sequence[int], n: int, since: Sequence[Solved] = ()
                  ) -> Asks:
        """n steps of a fit of some of the group, at the strides that these takes need."""
        bounds = [self.group[b].bounds() for b in which]
        if not self.walking:
            return fit_blocks(start, leaves, bounds, n, FIT.stride_fixed, since)
        return fit_blocks(start, leaves, bounds, n, FIT.stride_free, since, self.group[which[0]].magnitudes(start[0]))

    def _judge(self, b: int, x: Array, answer: dict[int, Array]) -> CandidateFit:
        joint = self.joints[b]
        off = {
            use: self.evaluator.cost(self.base, use, joint) - self.evaluator.cost(answer, use, joint) for use in ("fit", "choose")
        }
        before, after = (self.evaluator.by_channel(r, "choose", joint)[0] for r in (self.base, answer))
        return CandidateFit(self.group[b], x, off, joint, closed=self.evaluator.share_closed(self.base, answer, joint),
                     by_channel=before - after)

    def _question(self, which: Sequence[int], sizes: Sequence[Array]) -> RolloutRequest:
        """The request of the robot with the accepted effects, and those of the group at these sizes."""
        model = with_effects(self.with_these, [(self.group[b], x) for b, x in zip(which, sizes)])
        return RolloutRequest(model, self.takes, PROBLEM.coarse if self.coarse else 1.0)

    def _fine_residuals(self, answer: dict[int, Array]) -> dict[int, Array]:
        """Residuals of an answer: the difference at coarse steps, added to the residuals at the search's step."""
        return {i: self.base[i] + r - self.without[i] for i, r in answer.items()} if self.coarse else answer

    def _vectors_by_joint(self, answer: dict[int, Array]) -> list[Array]:
        return [self.evaluator.vector(answer, "fit", j) for j in self.joints]
