"""A session with linear responses: each parameter's effect is given, and fits converge at once."""

from types import SimpleNamespace

import numpy as np

from workbench.effects.registry import known_effects
from workbench.identify.fitting.fit import Fit
from workbench.identify.parameters import Candidate
from workbench.identify.selection.record import CandidateFit
from workbench.robot import puppy_model

COUNT = 900
"""Number of observations."""


def candidate(name):
    effect, model = known_effects()[name], puppy_model()
    where = {"joint": ("flm",), "link": (model.base,), "robot": ()}[effect.places[0]]
    return Candidate.of(effect, where, effect.neutral(model))


def trial(name, closed=0.5, joint="knee"):
    effect = known_effects()[name]
    c = Candidate.of(effect, ("knee",), effect.neutral(SimpleNamespace()))
    return CandidateFit(c, np.ones(c.size), {"fit": 1.0, "choose": 1.0}, joint, screened_out=True, closed=closed)


def names(sets):
    return [{t.candidate.name for t in chosen} for chosen in sets]


class LinearSearch:
    """does: by effect, the response to each parameter at its typical size, on one take; sizes: the hidden truth."""

    fitted, nominal = (0,), None

    def __init__(self, does, **sizes):
        self.does = does
        self.recorded = self.sum([(candidate(name), np.array(x)) for name, x in sizes.items()])
        self.asked = 0
        self.evaluator = SimpleNamespace(
            residuals=self.answers, vector=lambda left, use: left[0][:, 0],
            cost=lambda left, use: (2.0 if use == "fit" else 1.0) * float(sum(np.sum(r**2) for r in left.values())),
            by_channel=lambda left, use: (np.array([np.sum(left[0] ** 2)]), np.array([COUNT])))

    def sum(self, sizes):
        return sum((v * d for c, x in sizes for v, d in zip(x, self.does[c.name])), np.zeros(COUNT))

    def answers(self, questions):
        self.asked += len(questions)
        return [{0: (self.recorded - self.sum(q.model))[:, None]} for q in questions]

    def evaluate(self, sizes):
        left = (self.recorded - self.sum(sizes))[:, None]
        cost = float(np.sum(left**2))
        x = np.concatenate([np.empty(0), *(x for _, x in sizes)])
        return Fit(tuple(c for c, _ in sizes), x, np.eye(len(x)), {"fit": 2 * cost, "choose": cost}, {0: left})

    def evaluating(self, *lists):
        yield []
        return [self.evaluate(sizes) for sizes in lists]

    def refitting(self, fit, takes, steps):
        yield []
        A = np.column_stack([d for c in fit.effects for d in self.does[c.name]])
        return self.evaluate(fit.sizes(np.linalg.lstsq(A, self.recorded, rcond=None)[0]))

    def side_by_side(self, parts):
        return [self.run(p) for p in parts]

    def run(self, part):
        try:
            wants = next(part)
            while True:
                wants = part.send(self.answers(wants))
        except StopIteration as end:
            return end.value

    def is_settled(self, c):
        return False

    def telling(self, effects, takes):
        return takes
