"""Maps the joints of a log to the model's names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from workbench.files import InputError
from workbench.files.errors import MistypedError
from workbench.files.nearest import did_you_mean
from workbench.recording.recording import Recording
from workbench.robot import RobotModel

SO101_JOINTS = ("Rotation", "Pitch", "Elbow", "Wrist_Pitch", "Wrist_Roll", "Jaw")
"""Order of the columns of an npz, which does not name them (the SO-101's joint_list.txt)."""
URDF_JOINTS = dict(zip(SO101_JOINTS, ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")))
"""The same joints by their names in the arm's published URDF."""


def named_by_model(recording: Recording, model: RobotModel) -> Recording:
    """A log with the model's joint names. If a log does not name its only joint, that is the model's only one; otherwise the
    names are the model's, or aliases that the format knows."""
    joints = recording.joints
    if recording.nameless:
        if len(model.joints) != 1:
            raise InputError(recording.source, f"a log of one servo needs a model with one joint, not {len(model.joints)}")
        return _rename(recording, {joints[0]: model.joints[0]})
    if set(joints) == set(recording.aliases) and set(recording.aliases.values()) <= set(model.joints):
        return _rename(recording, recording.aliases)
    unknown = [j for j in joints if j not in model.joints]
    if unknown:
        raise MistypedError(recording.source, f"unknown joint '{unknown[0]}'; the model's are {', '.join(model.joints)}"
                            + did_you_mean(unknown[0], model.joints))
    return recording


def _rename(recording: Recording, names: Mapping[str, str]) -> Recording:
    """The recording with its joints renamed; `names`: new names by old ones."""
    channels = {}
    for channel, values in recording.channels.items():
        what, dot, joint = channel.partition(".")
        channels[f"{what}{dot}{names.get(joint, joint)}"] = values
    sent = recording.commands
    commands = sent and replace(sent, joints=tuple(names.get(j, j) for j in sent.joints))
    notes = recording.notes
    for old, new in names.items():
        notes = tuple(text.replace(f".{old} ", f".{new} ") for text in notes)
    return replace(recording, channels=channels, commands=commands, notes=notes)
