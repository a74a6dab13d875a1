"""What inverse dynamics found, to look at: figures, and the margins as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping

from matplotlib.figure import Figure

from workbench.dynamics import InverseDynamicsResult
from workbench.robot import GRAVITY, RobotModel
from workbench.view.figures import base_wrench, joint_torques, servo_margins


def force_figures(result: InverseDynamicsResult, model: RobotModel) -> Mapping[str, Figure]:
    """Figures by name: torque of each joint, margins of each servo, and on a free base the wrench that no contact supplies."""
    limit = {j: model.servo(j).torque_at_full_duty for j in result.joints}
    torques = {"on the link": result.torque, "of the motor": result.motor_torque}
    figures = {"torques": joint_torques(result.time, result.joints, torques, limit=limit),
               "margins": servo_margins(model, result.joints, result.motor_torque, result.v)}
    if result.base != "fixed":
        weight = GRAVITY * model.kinematics.mass
        figures["base_wrench"] = base_wrench(result.time, result.base_wrench_residual, result.residual_sigma, weight=weight)
    return figures


def margin_table(result: InverseDynamicsResult) -> str:
    """A line for each servo, the one with least torque left first."""
    lines = ["joint     rms    peak   left   N m   speed left  rad/s   time above a fifth of stall torque"]
    for joint, load in sorted(result.loads.items(), key=lambda item: item[1].torque_margin):
        mark = "" if load.feasible or math.isnan(load.torque_margin) else "   more than the servo has"
        lines.append(f"{joint:6s} {load.rms:6.2f}  {load.peak:6.2f} {load.torque_margin:6.2f}         {load.speed_margin:6.2f}"
                     f"          {100 * load.beyond_fifth:5.0f} %{mark}")
    return "\n".join(lines)
