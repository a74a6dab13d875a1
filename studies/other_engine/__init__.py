"""The robot in another engine: MuJoCo, with servo, contact, firmware and capture code of its own.

It shares no simulation code with the workbench, only plain data (`RobotModel`, `ServoConstants`, `Commands`), so that
an agreement between the two means something. It makes recordings whose physics is known (`make_session`), and is what
the bench races against (`bench`). A run goes through stages, each of which takes and returns plain data; between them
is where physics that the model does not have can be put in:

    firmware (what is sent) ->
    description (links, joints, feet) -> mjcf (MuJoCo's model) -> player (with the servo bank) -> capture (what is seen)
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
