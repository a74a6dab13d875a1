"""Texts and commands of a controller's loader (data/loaders), and whether an image is a program for it."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path

from workbench.files import InputError
from workbench.files.yaml_file import read_yaml
from workbench.robot import data_file

RAM, RAM_END = 0x20000000, 0x20010000


@dataclass(frozen=True)
class LoaderProfile:
    """What data/loaders says of a loader; texts as bytes, `confirmed` where a real one was heard to say them."""

    name: str
    confirmed: bool
    rate: int
    key: bytes
    key_every: float
    line_end: bytes
    byte_sum: bool
    prompt: tuple[bytes, ...]
    identity: tuple[bytes, ...]
    load: bytes
    keep: bytes
    start: bytes
    ready: tuple[bytes, ...]
    success: tuple[bytes, ...]
    refused: tuple[bytes, ...]
    failure: tuple[bytes, ...]
    started: tuple[bytes, ...]
    application: int
    flash_end: int
    source: str = field(default="", compare=False)


def load_loader_profile(path: str | Path | None = None) -> LoaderProfile:
    """Reads a loader's texts (default: the CM-530's); InputError names file and key."""
    path = Path(path) if path else data_file("loaders/cm530.yaml")
    content = read_yaml(path)
    if not isinstance(content, dict):
        raise InputError(path, "expected a mapping")
    kinds: dict[str, type | tuple[type, ...]] = {
        "format": int, "name": str, "confirmed": (bool, str), "rate": int, "key": str, "key_every": float, "line_end": str,
        "byte_sum": bool, "prompt": list, "identity": list, "commands": dict, "ready": list, "success": list,
        "refused": list, "failure": list, "started": list, "application": (int, str), "flash_end": (int, str),
    }
    for key, kind in kinds.items():
        if not isinstance(content.get(key), kind):
            raise InputError(path, f"key '{key}' is missing or of another kind")
    for key in content:
        if key not in kinds:
            raise InputError(path, f"unknown key '{key}'; expected one of {', '.join(sorted(kinds))}")

    def texts(key: str) -> tuple[bytes, ...]:
        found = tuple(str(t).encode() for t in content[key])
        if not found or b"" in found:
            raise InputError(path, f"key '{key}': expected at least one text, none of them empty")
        return found

    def address(key: str) -> int:
        try:
            return int(str(content[key]), 0)
        except ValueError:
            raise InputError(path, f"key '{key}': expected an address such as 0x08003000") from None

    commands = content["commands"]
    if set(commands) != {"load", "keep", "start"}:
        raise InputError(path, "key 'commands': expected load, keep and start")
    return LoaderProfile(
        content["name"], bool(content["confirmed"]), content["rate"], content["key"].encode(), content["key_every"],
        content["line_end"].encode(), content["byte_sum"], texts("prompt"), texts("identity"), commands["load"].encode(),
        commands["keep"].encode(), commands["start"].encode(), texts("ready"), texts("success"), texts("refused"),
        texts("failure"), texts("started"), address("application"), address("flash_end"), str(path))


def check_image(image: bytes, profile: LoaderProfile, source: str) -> None:
    """InputError unless this can be a program for that place: stack in RAM, reset vector inside, not longer than the flash."""
    room = profile.flash_end - profile.application
    if not 256 <= len(image) <= room:
        raise InputError(source, f"{len(image)} bytes; a program for the {profile.name} has 256 to {room}")
    stack, start = struct.unpack_from("<II", image)
    inside = profile.application <= start - 1 < profile.application + len(image)
    if not (RAM < stack <= RAM_END and stack % 4 == 0 and start & 1 and inside):
        raise InputError(source, f"its first words, {stack:#x} and {start:#x}, are no stack and start of a program at "
                                 f"{profile.application:#x}")
