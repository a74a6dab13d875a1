"""Figures of what fits cost, for `workbench bench`: beside another toolbox, and where the time of a diagnosis goes.

They live here because simulation's figures may not see what is above them.
"""

from __future__ import annotations

from collections.abc import Callable

from workbench.gap.bench.diagnose_time import diagnose_time
from workbench.gap.bench.sysid import fit_against_mujoco_sysid
from workbench.simulation.bench import Figure

SEED = 0
LOG, LOG_QUICK, LOG_DIAGNOSED = 4.0, 0.3, 2.4
"""Seconds of motion."""
TURNS = 2


def fit_figures(quick: bool, progress: Callable[[str], None]) -> list[Figure]:
    """Both figures."""
    progress("fit against MuJoCo's system identification")
    fit = fit_against_mujoco_sysid(LOG_QUICK, 1, SEED, iterations=1) if quick else fit_against_mujoco_sysid(LOG, TURNS, SEED)
    progress("where a diagnosis spends its time")
    return [fit, diagnose_time(None if quick else LOG_DIAGNOSED, SEED)]
