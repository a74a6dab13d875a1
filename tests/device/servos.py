"""Virtual servos of three families on a bus, and the robot that the model says they are."""

from dataclasses import dataclass, replace

from workbench.device.bus import Bus
from workbench.device.virtual import AX12A, STS3215, XL330, Clock, RampBody, ServoBus, VirtualPort, VirtualServo
from workbench.robot import BUS_IDS, puppy_model
from workbench.robot.servo_profile_file import servo_profile

FAMILIES = {"AX-12A": (AX12A, 11.1), "XL-330": (XL330, 5.0), "STS3215": (STS3215, 7.4)}


@dataclass
class Robot:
    """model: as it should be. servos: by joint."""

    model: object
    wire: ServoBus
    body: RampBody
    servos: dict
    port: VirtualPort

    def bus(self, **options):
        return Bus(self.port, servo_profile(self.model.servo("flm").model), {i: j for j, i in BUS_IDS.items()}, **options)

    def at(self, seconds, action):
        """Has something happen so many seconds from now."""
        self.wire.clock.after(round(seconds * 72_000_000), action)


def robot(family="AX-12A", angles=None, joints=None):
    """The puppy on servos of a family, each as it leaves the factory but for its ID and rate of 1 Mbit/s."""
    model = puppy_model()
    if family != "AX-12A":
        model = replace(model, servos=dict.fromkeys(model.joints, servo_profile(family).constants()))
    profile, volts = FAMILIES[family]
    wire = ServoBus(Clock())
    wire.supply = volts
    body = RampBody({BUS_IDS[j]: a for j, a in (angles or {}).items()})
    servos = {j: VirtualServo(wire, profile, BUS_IDS[j], body) for j in joints or BUS_IDS}
    for servo in servos.values():
        servo["return_delay_time"] = 0
        if servo.has("position_p_gain") and family == "XL-330":
            servo["position_p_gain"] = 400
    return Robot(model, wire, body, servos, VirtualPort(wire))
