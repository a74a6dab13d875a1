"""The page of a torque gap: recorded against required torque of each joint, and the load that would explain the difference."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from workbench.dynamics.torque_gap import TorqueGap
from workbench.robot import RobotModel
from workbench.view.figures import joint_torques
from workbench.view.report.page import Picture, Provenance, Report, Section, Table


def torque_report(gaps: Mapping[str, TorqueGap], compared: str, model: RobotModel) -> Report:
    """The page of one log's gap, or of several; compared: their difference in a sentence, or empty."""
    first = next(iter(gaps.values()))
    report = Report("Torque gap", compared or _headline(first), "Recorded torque minus the torque that the model requires for "
                    "the recorded motion, with its base held level.", provenance=Provenance.of(model))
    for name, gap in gaps.items():
        rows = [[g.joint, f"{g.recorded:.3f}", f"{g.gap:.3f}", f"{g.mean:+.3f}", f"{g.with_load:.3f}"] for g in gap.joints]
        table = Table(["joint", "recorded", "gap", "mean gap", "gap with the load"], rows, "RMS and mean [N m]")
        report.add(Section(name, [table, Picture(_figure(gap), f"{name}: {gap.load_line()}")]))
    return report


def _headline(gap: TorqueGap) -> str:
    worst = gap.joints[0]
    return f"{worst.joint} differs most, by {worst.gap:.3f} N m RMS; {gap.load_line()}."


def _figure(gap: TorqueGap) -> Figure:
    torques = {"recorded": gap.torque, "required by the model": gap.required}
    return joint_torques(gap.time, gap.columns, torques)
