"""Virtual servos of three families on a bus, and the robot that the model says they are."""

from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.arm import arm_sdf
from workbench.device.bus import Bus
from workbench.device.virtual import (
    AX12A,
    MX28,
    SECOND,
    STS3215,
    XL330,
    XL430,
    Clock,
    RampBody,
    ServoBus,
    VirtualPort,
    VirtualServo,
)
from workbench.robot import RobotModel, puppy_model
from workbench.robot.servo_profile_file import servo_profile

FAMILIES = {"AX-12A": (AX12A, 11.1), "XL-330": (XL330, 5.0), "XL-430": (XL430, 11.1), "STS3215": (STS3215, 7.4),
            "MX-28": (MX28, 12.0)}


@dataclass
class Robot:
    """model: as it should be. servos: by joint."""

    model: RobotModel
    wire: ServoBus
    body: RampBody
    servos: dict
    port: VirtualPort

    def bus(self, **options):
        profile = servo_profile(self.model.servo(self.model.joints[0]).model)
        return Bus(self.port, profile, {i: j for j, i in self.model.bus_ids.items()}, **options)

    def at(self, seconds, action):
        """Has something happen so many seconds from now."""
        self.wire.clock.after(round(seconds * SECOND), action)


def arm(folder: Path) -> RobotModel:
    """An arm of three joints."""
    path = folder / "arm.sdf"
    path.write_text(arm_sdf(True))
    return RobotModel(description=str(path), base="trunk", bus_ids={"one": 1, "two": 2, "three": 3})


def robot(family="AX-12A", angles=None, joints=None, model=None):
    """A robot (default: the puppy) on servos of a family, as they leave the factory but for their IDs, a rate of 1 Mbit/s and no
    return delay."""
    model = model or puppy_model()
    if family != "AX-12A":
        model = replace(model, servos=dict.fromkeys(model.joints, servo_profile(family).constants()))
    profile, volts = FAMILIES[family]
    wire = ServoBus(Clock())
    wire.supply = volts
    ids = model.bus_ids
    body = RampBody({ids[j]: a for j, a in (angles or {}).items()}, fastest=50.0)
    servos = {j: VirtualServo(wire, profile, ids[j], body) for j in joints or ids}
    for servo in servos.values():
        servo["return_delay_time"] = 0
    return Robot(model, wire, body, servos, VirtualPort(wire))
