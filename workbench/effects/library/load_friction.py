"""Coulomb friction that grows with the torque that the gear transmits."""

from __future__ import annotations

from collections.abc import Mapping

from workbench.effects.base import DEGREE, Effect, Parameter, scalar
from workbench.robot import EffectSpec, RobotModel
from workbench.servo import LoadFrictionTerm, ServoTerm
from workbench.types import Mask


class LoadFriction(Effect):
    """Coulomb friction that grows with the torque that the gear transmits, more than nominal or less. To be driven backwards, the
    gear needs a torque of 1 / (1 - coefficient) times its Coulomb friction; from a coefficient of 1 on, it cannot be driven
    backwards.

    Two optional parts, as in published friction models of such servos (M. Duclusaud and G. Passault, arXiv 2410.08650): `static`,
    additional friction at rest, decaying as exp(-(w / speed)^2); `backdrive`, additional friction where motor torque and motion
    are opposed, so that the load drives the motor. Friction grows up to a load of MOST_LOAD times the torque at full duty.
    """

    name = "load_friction"
    layer = "actuator"
    places = ("joint",)
    family = "friction"
    under_load = True
    needs_steady_load = True
    # 0.17 and 0.3 by fits to an XL-330 and an STS3215; from about half on, a gear holds its load without motor torque
    parameters = (
        Parameter("coefficient", "", 0.0, 1.0, 0.15, seldom_beyond=0.6, adds_to="load_friction"),
        Parameter("static", "", 0.0, 1.0, 0.15, option="static", seldom_beyond=0.6),
        Parameter("speed", "deg/s", 0.5, 400.0, 20.0, si=DEGREE, shapes=True, option="static"),
        Parameter("backdrive", "", 0.0, 1.0, 0.15, option="backdrive", seldom_beyond=0.6))

    def sentence(self, spec: EffectSpec) -> str:
        static, backdrive = (float(spec.parameters.get(name, 0.0)) for name in ("static", "backdrive"))  # type: ignore[arg-type]
        more = [f"{100 * static:.0f} % at rest"] if static else []
        more += [f"{100 * backdrive:.0f} % where the load drives the motor"] if backdrive else []
        added = f", plus {' and '.join(more)}" if more else ""
        share = 100 * scalar(spec, "coefficient")
        less = " less" if share < 0 else ""
        return f"{', '.join(spec.where)} loses {abs(share):.0f} %{less} of the transmitted torque to friction{added}."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return 0.0, 0.0, self.parameters[2].typical, 0.0

    def servo_term(self, here: Mask, values: Mapping[str, float]) -> ServoTerm:
        at = here.astype(float)
        return LoadFrictionTerm(at * values["coefficient"], at * values["static"], values["speed"], at * values["backdrive"])


EFFECT = LoadFriction()
