"""Effects that a fit cannot tell from nothing are refuted, however likely the fit itself came out."""

from tests.evidence.linear import candidate
from tests.evidence.test_search import OPTIONS, robot, searched
from workbench.identify.evidence.fit import fitting
from workbench.identify.evidence.hypothesis import log_odds
from workbench.identify.evidence.nested import told_from_nothing
from workbench.identify.evidence.search import lockstep


def refuted(rollouts, names: dict[str, float]):
    """Names of effects at these sizes that are refuted, with by how much [nats]."""
    after, found, _ = searched(rollouts)
    best = found.best
    h = best.hypothesis.without(lambda c: True)
    for name, size in names.items():
        c = candidate(name)
        h = h.with_effect(c, [size] + [0.0] * (c.size - 1))
    fit = lockstep(after, {0: fitting(found.region, OPTIONS, h, best.discrepancy, OPTIONS.iterations)})[0]
    said = lockstep(after, {0: told_from_nothing(found.region, OPTIONS, fit)})[0]
    return {c.name: why.behind for c, why in said.items()}


def test_what_is_there_stays_and_what_is_not_goes():
    said = refuted(robot({"load_friction": 2.0}), {"load_friction": 2.0, "backlash": 0.0})
    assert said.keys() == {"backlash"}
    assert said["backlash"] > -log_odds(6, OPTIONS.expected)


def test_nothing_is_refuted_where_all_effects_are_there():
    assert refuted(robot({"load_friction": 2.0, "backlash": 1.5}), {"load_friction": 2.0, "backlash": 1.5}) == {}
