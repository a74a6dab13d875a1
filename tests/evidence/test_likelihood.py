"""The likelihood against closed forms: marginal likelihoods of linear models, correlation times of known processes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from scipy.stats import t as student

from workbench.identify.evidence.likelihood import Likelihood, correlation_time


def white(n: int, noise: float = 0.5, tails: float = 4.0, between=(1e-3, 10.0)) -> Likelihood:
    return Likelihood(np.full(n, noise), np.full(n, 0.02), 0.01, tails, between)


def test_independent_frames_have_students_density():
    r = np.random.default_rng(0).normal(size=50)
    assert white(50).log(r, 1.2) == pytest.approx(student.logpdf(r, 4.0, scale=np.hypot(0.5, 1.2)).sum())


def test_frames_count_less_the_longer_they_are_correlated():
    r = np.random.default_rng(0).normal(size=50)
    slow = replace(white(50), tau=0.1)
    assert slow.counts.sum() == pytest.approx(5.0)
    assert slow.log(r, 1.0) == pytest.approx(white(50).log(r, 1.0) / 10)


def test_least_squares_rows_have_the_likelihoods_slope():
    r, at, step = np.linspace(-3.0, 3.0, 31), white(31), 1e-6
    rows = at.rows(r, 0.7)
    assert -0.5 * np.sum(np.square(rows)) - at.log(r, 0.7) == pytest.approx(-at.log(0 * r, 0.7))
    np.testing.assert_allclose(at.slope(r, 0.7), (at.rows(r + step, 0.7) - at.rows(r - step, 0.7)) / (2 * step), rtol=1e-4)


def test_evidence_of_a_linear_model_is_its_marginal_likelihood():
    """With tails of a normal distribution and a discrepancy that is given, Laplace's form is exact."""
    rng = np.random.default_rng(1)
    n, s = 40, 0.8
    A, prior = rng.normal(size=(n, 2)), np.array([2.0, 0.5])
    y = A @ [1.0, -0.3] + rng.normal(size=n)
    scale = np.hypot(0.5, s)
    S = scale**2 * np.eye(n) + A @ np.diag(prior**2) @ A.T
    x = np.linalg.solve(A.T @ A / scale**2 + np.diag(prior**-2.0), A.T @ y / scale**2)
    log_prior = -0.5 * np.sum(np.square(x / prior)) - np.sum(np.log(prior)) - np.log(2 * np.pi)
    at = white(n, tails=1e7, between=(s, s * (1 + 1e-9)))
    found, where = at.evidence(y - A @ x, -A, float(log_prior), prior**-2.0)
    assert found == pytest.approx(multivariate_normal(np.zeros(n), S).logpdf(y), abs=1e-3)
    assert where == pytest.approx(s)


def test_the_discrepancy_is_what_noise_does_not_explain():
    r = np.random.default_rng(2).standard_t(4, size=4000) * np.hypot(0.5, 0.3)
    assert white(4000).discrepancy(r) == pytest.approx(0.3, rel=0.1)
    assert white(4000).discrepancy(0.5 * np.random.default_rng(3).standard_t(4, size=4000)) < 0.15


@pytest.mark.parametrize(("memory", "expected"), [(0.0, 0.5), (0.8, 4.5), (0.95, 19.5)])
def test_correlation_time_of_an_autoregressive_process(memory, expected):
    """(1 + a) / (1 - a) / 2 frames; also where a third of the frames is unseen."""
    rng = np.random.default_rng(0)
    series = []
    for _ in range(4):
        x = np.zeros(20_000)
        for k, e in enumerate(rng.normal(size=len(x))):
            x[k] = memory * x[k - 1] + e
        x[(np.arange(len(x)) // 20) % 3 == 0] = np.nan
        series.append((x, 0.1))
    assert correlation_time(series) == pytest.approx(0.1 * expected, rel=0.2)
