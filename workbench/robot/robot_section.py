"""Reads `robot:` and `ground:` of a YAML file (docs/formats.md, section 1), in sessions and in fitted models."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from workbench.files import InputError
from workbench.files.yaml_file import Fields, read_yaml
from workbench.physical import GROUND
from workbench.robot.model import PUPPY, Ground, RobotModel, puppy_model
from workbench.robot.mounting import Mounting, read_lerobot, read_mountings
from workbench.robot.names import BUS_IDS, HIGHEST_BUS_ID, HIGHEST_ID, RIGID_BODIES
from workbench.robot.servo_constants import KEYS, ServoConstants, servo_constants
from workbench.robot.servo_profile_file import family_of_servo, servo_profile, with_family_law

_CONSTANTS = set(KEYS)


def read_model(top: Fields) -> RobotModel:
    """The robot of a file's `robot` and `ground`. InputError names the file, the key and the expected value."""
    ground = _ground(top.mapping("ground"))
    f = top.mapping("robot") or Fields(top.path, {}, "robot")
    f.only("model", "base", "servos", "rigid_bodies", "bus_ids", "calibration", "direction", "offset", "homing", "feet", "held",
           "packages")
    packages = _packages(f)
    description = f.text("model", PUPPY) or PUPPY
    if not description.startswith("package://"):
        description = str(f.existing("model", description))
    try:
        model = puppy_model() if description == PUPPY else RobotModel(description, packages=packages)
    except InputError as e:
        raise f.error("model", str(e)) from None
    kinematics = model.kinematics
    links, joints = kinematics.links, model.joints
    base = f.text("base", model.base if model.base in links else kinematics.root) or ""
    if base not in links:
        raise f.error("base", f"the model has no link '{base}'; expected one of {', '.join(links)}")
    bodies = _rigid_bodies(f, links)
    ids, mountings = _bus(f, joints)
    feet = _feet(f, links)
    servos = read_servos(f, joints, by_family=True)
    check_protocol(f, ids, servos)
    held = f.flag("held")
    f.done()
    return replace(model, base=base, rigid_bodies=bodies, bus_ids=ids, mountings=mountings, servos=servos or model.servos,
                   ground=ground or model.ground, feet=feet, held=held)


def _ground(f: Fields | None) -> Ground | None:
    if f is None:
        return None
    given = {key: f.number(key, finite=not GROUND[key].infinite) for key in GROUND}
    f.done()
    try:
        return Ground(**given)
    except InputError as e:
        raise InputError(f.path, f"{f.place}.{e.problem}") from None


def _packages(f: Fields) -> dict[str, str]:
    """Folders of ROS packages, relative to the file."""
    given = f.mapping("packages")
    folders = {}
    for name, folder in given.items() if given is not None else ():
        path = f.path.parent / folder if isinstance(folder, str) else None
        if path is None or not path.is_dir():
            raise f.error(f"packages.{name}", f"expected a folder, got {folder!r}")
        folders[name] = str(path.resolve())
    return folders


def _rigid_bodies(f: Fields, links: tuple[str, ...]) -> dict[str, str]:
    given = f.mapping("rigid_bodies")
    if given is None:
        return {a: link for a, link in RIGID_BODIES.items() if link in links}
    bodies = {asset: _name(given, asset, link, "link", links) for asset, link in given.items()}
    twice = [link for link in bodies.values() if list(bodies.values()).count(link) > 1]
    if twice:
        raise f.error("rigid_bodies", f"link '{twice[0]}' carries two assets; expected one each")
    return bodies


def _feet(f: Fields, links: tuple[str, ...]) -> tuple[str, ...] | None:
    given = f.raw("feet")
    if given is None:
        return None
    if not isinstance(given, list) or len({str(link) for link in given}) != len(given):
        raise f.error("feet", f"expected a list of links, each once, got {given!r}")
    return tuple(_name(f, "feet", link, "link", links) for link in given)


def _bus(f: Fields, joints: tuple[str, ...]) -> tuple[dict[str, int], dict[str, Mounting]]:
    """IDs and mountings, either written out or from LeRobot's calibration file."""
    calibration = f.file("calibration")
    if calibration is None:
        return _bus_ids(f, joints), read_mountings(f, joints)
    for key in ("bus_ids", "direction", "offset", "homing"):
        if f.raw(key) is not None:
            raise f.error(key, "is in the file that `calibration` names; expected one of the two")
    return read_lerobot(calibration, joints)


def _bus_ids(f: Fields, joints: tuple[str, ...]) -> dict[str, int]:
    given = f.mapping("bus_ids")
    if given is None:
        return {j: i for j, i in BUS_IDS.items() if j in joints}
    ids: dict[str, int] = {}
    for joint, number in given.items():
        _name(given, joint, joint, "joint", joints)
        good = isinstance(number, int) and not isinstance(number, bool) and 0 <= number <= HIGHEST_BUS_ID
        if not good or number in ids.values():
            raise given.error(joint, f"expected a bus ID of its own from 0 to {HIGHEST_BUS_ID}, got {number!r}")
        ids[joint] = number
    return ids


def check_protocol(f: Fields, ids: Mapping[str, int], servos: Mapping[str, ServoConstants]) -> None:
    """InputError in the file's section `robot`, f, where a servo cannot have its ID: protocol 2 reserves one that protocol 1
    allows."""
    for joint in sorted(ids.keys() & servos.keys()):
        family = family_of_servo(servos[joint].model)
        if family is not None and ids[joint] > HIGHEST_ID[family.protocol]:
            raise f.error(f"bus_ids.{joint}", f"expected at most {HIGHEST_ID[family.protocol]}, the highest ID of protocol "
                                              f"{family.protocol} ({family.name}), got {ids[joint]}")


def read_servos(f: Fields, joints: tuple[str, ...], by_family: bool = False) -> dict[str, ServoConstants]:
    """Constants by joint, of the key `servos`: one for all or one for each, as files or inline; empty where it is absent.

    by_family: whether parts of the servo's law that the file omits (delay, goal ramp, minimum duty, dead zone, load friction, …)
    come from its family's profile, with its uncertainty; else they are absent.
    """
    given = f.raw("servos")
    if given is None:
        return {}
    if not isinstance(given, Mapping) or not set(given).isdisjoint(_CONSTANTS.difference(joints)):
        return dict.fromkeys(joints, _constants(f, "servos", given, by_family))
    each = Fields(f.path, given, f.at("servos"))
    return {_name(each, joint, joint, "joint", joints): _constants(each, joint, value, by_family)
            for joint, value in each.items()}


def _constants(f: Fields, key: str, value: Any, by_family: bool) -> ServoConstants:
    path, place = (f.path, f.at(key)) if isinstance(value, Mapping) else (f.existing(key, value), "")
    content = value if isinstance(value, Mapping) else read_yaml(path)
    if isinstance(content, Mapping) and set(content) == {"model"}:
        return _nominal(f, key, content["model"])
    servo = servo_constants(content, path, place)
    return with_family_law(servo, content) if by_family else servo


def _nominal(f: Fields, key: str, name: Any) -> ServoConstants:
    """Constants of a servo of which only the name is known."""
    try:
        return replace(servo_profile(str(name)).constants(), model=str(name))
    except InputError as e:
        raise f.error(key, f"model: {e.problem}") from None


def _name(f: Fields, key: str, value: Any, kind: str, known: tuple[str, ...]) -> str:
    if value not in known:
        raise f.error(key, f"the model has no {kind} '{value}'; expected one of {', '.join(known)}")
    return str(value)
