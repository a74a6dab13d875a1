"""One simulated take, as figures."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from workbench.compare.footfalls import foot_phases
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.view.figures import body_attitude, body_path, by_joint, footfalls, joint_grid, joint_torques, stance_of


def rollout_figures(take: Take, model: RobotModel) -> Mapping[str, Figure]:
    """Figures by name: angles against commands, torques against full duty, and of a free base path, attitude and footfalls."""
    stance = stance_of(foot_phases(take, model), take)
    figures = {"joints": joint_grid(take, stance=by_joint(stance, model))}
    if take.torque is not None:
        limit = {j: model.servo(j).torque_at_full_duty for j in take.joints}
        figures["torques"] = joint_torques(take.since_start, take.joints, {"on the link": take.torque}, limit=limit)
    if take.base == "free":
        figures |= {"path": body_path(take), "attitude": body_attitude(take)}
        if stance:
            figures["footfalls"] = footfalls(stance, span=(0.0, float(take.since_start[-1])))
    return figures
