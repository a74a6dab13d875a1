"""Is Laplace's evidence right? The same likelihood and priors by nested sampling, on logs of a real servo.

    python -m studies.evidence [--out runs/studies/evidence] [--quick]

For models of two logs of the XL-330 (data of ../shared, not part of the project): log evidence by Laplace's approximation at the
fitted numbers (workbench/identify/evidence/likelihood.py), and by dynesty (J. Speagle, MNRAS 493, 2020), at the same discrepancy
and correlation time. Quick: one model, fewer live points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import cauchy, norm

from studies.common import run_study
from studies.xl330.__main__ import DATA
from studies.xl330.rig import find_logs, published, write_session
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes
from workbench.effects.registry import effect_named
from workbench.files.reading import write_whole
from workbench.identify.evidence.fit import Fitted, fit_hypothesis
from workbench.identify.evidence.hypothesis import Hypothesis, Prior, start
from workbench.identify.evidence.nuisance import uncertain_numbers
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.region import region_of
from workbench.identify.evidence.rollouts import Rollouts
from workbench.identify.evidence.search import lockstep
from workbench.identify.parameters import Candidate
from workbench.identify.preparation import prepare
from workbench.identify.rollouts.evaluator import RolloutEvaluator
from workbench.simulation import SimulationConfig
from workbench.types import Array

MODELS = ((), ("load_friction",), ("load_friction", "torque_saturation"))
LOGS = ("sin_sin_200", "up_and_down_200")
NUMBERS = ("torque_at_full_duty", "coulomb_friction", "zero")
"""Of the nominal law that are recalibrated here, so that sampling ends within minutes."""
OPTIONS = EvidenceOptions()


def evidence(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Compares both for each model and writes a table."""
    logs = [log for log in find_logs(DATA) if log.name in LOGS]
    session = load_session(write_session(out, logs, published(DATA, "m1")))
    takes, _ = read_takes(session)
    config = SimulationConfig(settle=0.1, contact_period=0, time_step=4e-3)
    evaluator = RolloutEvaluator(prepare(session, takes, config, 1, progress).evidence, config, 1)
    joint = session.model.joints[0]
    numbers = [n for n in uncertain_numbers(session.model, joint) if n.name in NUMBERS]
    region = region_of([joint], evaluator.evidence, numbers, (), OPTIONS)
    rollouts = Rollouts.of(evaluator, session.model, [region])
    rows = ["| model | Laplace [nats] | nested sampling [nats] | rollouts |", "|---|---|---|---|"]
    for names in MODELS[1:2] if quick else MODELS:
        progress(f"{' and '.join(names) or 'nominal'}", None)
        h = start(numbers)
        for name in names:
            c = Candidate.of(effect_named(name), (joint,), effect_named(name).neutral(session.model))
            h = h.with_effect(c, np.ones(c.size))
        s = region.likelihood.discrepancy(rollouts.answers([(0, h)])[0])
        for _ in range(2):
            region = region.with_correlation_time(region.correlation(rollouts.answers([(0, h)])[0]))
            rollouts = replace(rollouts, regions=(region,))
            fit: Fitted = lockstep(rollouts, {0: fit_hypothesis(region, OPTIONS, h, s, OPTIONS.iterations)})[0]
            h, s = fit.hypothesis, fit.discrepancy
        laplace = _laplace(region.likelihood.log(fit.r, s), fit, region.likelihood.precision(fit.r, s))
        sampled, error, count = _sampled(rollouts, h, s, 60 if quick else 200)
        rows.append(f"| {' and '.join(names) or 'nominal'} | {laplace:.2f} | {sampled:.2f} ± {error:.2f} | {count} |")
    write_whole(out / "evidence.md", "\n".join(rows) + "\n")
    return "\n".join(rows) + f"\nwrote {out / 'evidence.md'}"


def _laplace(log: float, fit: Fitted, precision: Array) -> float:
    """At the fit's discrepancy."""
    prior, theta = Prior.of(fit.hypothesis, OPTIONS), fit.hypothesis.theta
    H = (fit.J.T * precision) @ fit.J + np.diag(prior.precision(theta))
    return log + prior.log(theta) + 0.5 * len(theta) * float(np.log(2 * np.pi)) - 0.5 * float(np.linalg.slogdet(H)[1])


def _sampled(rollouts: Rollouts, h: Hypothesis, s: float, live: int) -> tuple[float, float, int]:
    """Log evidence at a discrepancy, its error, and how often the likelihood was asked."""
    import dynesty

    prior, likelihood = Prior.of(h, OPTIONS), rollouts.regions[0].likelihood
    low, high = h.bounds()

    def from_cube(u: Array) -> Array:
        half = np.where(prior.one_sided, 0.5 + 0.5 * u, u)
        theta = prior.center + prior.scale * np.where(prior.normal, norm.ppf(u), cauchy.ppf(half))
        return np.asarray(np.clip(theta, low, high))

    def log(theta: Array) -> float:
        return likelihood.log(rollouts.answers([(0, h.at(theta))])[0], s)

    sampler = dynesty.NestedSampler(log, from_cube, len(h.theta), nlive=live, rstate=np.random.default_rng(0))
    sampler.run_nested(dlogz=0.1, print_progress=False)
    found = sampler.results
    return float(found.logz[-1]), float(found.logzerr[-1]), int(np.sum(found.ncall))


if __name__ == "__main__":
    raise SystemExit(run_study("evidence", __doc__, evidence))
