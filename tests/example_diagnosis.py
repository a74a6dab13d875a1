"""A diagnosis as tests of its files and of its page take it: play in one joint of four legs, and all that may stand beside it."""

from __future__ import annotations

from workbench.identify.results.findings import (
    Alternative,
    Change,
    Diagnosis,
    Estimate,
    Finding,
    GapEntry,
    NextExperiment,
    Rejected,
    Unexplained,
    Verdict,
)
from workbench.identify.results.reasons import Dependence, Outdone, ScreenedOut
from workbench.robot import EffectSpec, RobotModel


def finding(effect: str = "backlash", confidence: float = 0.97) -> Finding:
    return Finding(effect, ("flm",), confidence, {"gap": Estimate(2.0, 1.8, 2.3, "deg")}, Change(1.9, 0.12, "deg"),
                   Change(2.0, 0.11, "deg"), (Alternative("joint_compliance", ("flm",), 0.02),), "It shows where the load turns.")


def diagnosis(model: RobotModel, verdict: Verdict = "explained", gaps: int = 8) -> Diagnosis:
    return Diagnosis(
        verdict, model.with_effect(EffectSpec("backlash", ("flm",), {"gap": 2.0})), model,
        gap=tuple(GapEntry("structure", ("flm",), "walk", ((0.5 + k, 1.2 + k),), 2.0, 0.1, "deg", "stance") for k in range(gaps)),
        findings=(finding(),),
        rejected=(Rejected("coulomb_friction", ("flm",), Outdone("dead_band", ("flm",), 900.0, 40.0), Change(2.0, 1.9, "deg")),
                  Rejected("payload", ("body_link",), ScreenedOut(12.0, 310.0))),
        unexplained=(Unexplained(("frb",), 0.6, 0.2, "deg", Dependence("a <take>", "frb", "angle", 0.6)),),
        next_experiment=NextExperiment("next_experiment.csv", "fixed", (("backlash", "joint_compliance"),)),
        provenance={"seed": 7, "seconds": 94.0}, left_out=(("trot", "line 9: the file is cut"),))
