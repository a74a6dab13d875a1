"""Results of inverse dynamics: figures, and the margins as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping

from matplotlib.figure import Figure

from workbench.dynamics import InverseDynamicsResult
from workbench.dynamics.margins import ServoLoad
from workbench.robot import GRAVITY, RobotModel
from workbench.view.figures import base_wrench, joint_torques, servo_margins

_MEASURED = ("sd: from the measurement noise, amplified by differentiating the angles twice; smoothing and the distribution of "
             "load between feet are not included. If a robot appears to exceed its servos' limits, its servos or loads differ "
             "from the model's.")


def force_figures(result: InverseDynamicsResult, model: RobotModel) -> Mapping[str, Figure]:
    """Figures by name: torque of each joint, margins of each servo, and for a free base the wrench that contacts cannot
    supply."""
    limit = {j: model.servo(j).torque_at_full_duty for j in result.joints}
    torques = {"on the link": result.torque, "of the motor": result.motor_torque}
    figures = {"torques": joint_torques(result.time, result.joints, torques, limit=limit),
               "margins": servo_margins(model, result.joints, result.motor_torque, result.v)}
    if result.base != "fixed":
        weight = GRAVITY * model.kinematics.mass
        figures["base_wrench"] = base_wrench(result.time, result.base_wrench_residual, result.residual_sigma, weight=weight)
    return figures


def margin_table(result: InverseDynamicsResult) -> str:
    """A line for each servo, sorted by torque margin; each margin with its standard deviation if the motion was measured."""
    lines = ["joint     rms    peak margin   N m           speed margin rad/s        time above a fifth of stall torque"]
    for joint, load in sorted(result.loads.items(), key=lambda item: item[1].torque_margin):
        lines.append(f"{joint:6s} {load.rms:6.2f}  {load.peak:6.2f} {_with(load.torque_margin, load.torque_sigma)}     "
                     f"{_with(load.speed_margin, load.speed_sigma)}     {100 * load.beyond_fifth:5.0f} %{_mark(load)}")
    if any(load.torque_sigma > 0 for load in result.loads.values()):
        lines.append(_MEASURED)
    return "\n".join(lines)


def _with(margin: float, sigma: float) -> str:
    return f"{margin:6.2f} {f'(sd {sigma:.2f})' if sigma > 0 else '':10s}"


def _mark(load: ServoLoad) -> str:
    if load.exceeded:
        return "   exceeds the servo's limit"
    negative = not load.feasible and not math.isnan(load.torque_margin)
    return "   no margin left, or none above the noise" if negative else ""
