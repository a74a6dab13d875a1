"""The robot in another engine: MuJoCo, with servo, contact, firmware and capture code of its own.

It shares no simulation code with the workbench, only plain data (`RobotModel`, `ServoConstants`, `Commands`), so that an
agreement between the two is meaningful. It makes recordings whose physics is known (`make_session`), and is the reference of
the bench (`bench`). A run goes through stages, each of which takes and returns plain data; physics that the model lacks can be
inserted between them:

    firmware (commands sent) ->
    description (links, joints, feet) -> mjcf (MuJoCo's model) -> player (with the servo bank) -> capture (observation)
"""

from studies.other_engine.capture import Camera, Capture, film
from studies.other_engine.description import Description, describe
from studies.other_engine.firmware import commands_from_rows
from studies.other_engine.mjcf import to_mjcf
from studies.other_engine.motive_file import write_motive_csv
from studies.other_engine.player import Rollout, play
from studies.other_engine.servo import Reference, ServoBank

__all__ = [
    "Camera", "Capture", "Description", "Reference", "Rollout", "ServoBank", "commands_from_rows", "describe", "film",
    "play", "to_mjcf", "write_motive_csv",
]
