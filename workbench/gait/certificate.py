"""The certificate of a gait: one JSON file, bound by hash to its tables and its model."""

from __future__ import annotations

import hashlib
import json
import math
import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from workbench.files import InputError
from workbench.files.reading import read_json, read_text
from workbench.gait.evaluate import table_sha256
from workbench.gait.limits import Margin
from workbench.gait.record import Nominal, Steadiness, Ways, from_plain, to_plain
from workbench.gait.shape import GaitShape
from workbench.motion import Motion, PoseTable
from workbench.robot import RobotModel

NAME = "certificate.json"
MARK = "made by workbench optimize; its certificate is certificate.json beside it"
"""First line of a motion that has a certificate."""
CLAIM = "All numbers are simulated: until a robot has walked it, a speed is a claim about the model."
PUPPY_CLAIM = f"{CLAIM} On this model the ROBOTIS walk covers 15.6 cm in six seconds; the robot of the thesis covered 37 cm."


ADDED = ("asked",)
"""Fields that the first certificates of format 1 have not."""
RECORDS: dict[str, type[Any]] = {"nominal": Nominal, "ways": Ways, "cycle": Steadiness}
"""Fields that are records of their own."""
_PLAIN: dict[str, type[Any]] = {"kept": bool, "request": str, "model_sha256": str}
"""Types of the fields that are neither records nor mappings."""
_SHOWN = {list: "a list", str: "text", int: "a number", float: "a number", bool: "true or false", type(None): "nothing"}
"""JSON's other values, in words."""


@dataclass(frozen=True)
class Certificate:
    """Results of the examination of a gait. Angles in degrees.

    kept: whether every limit is kept. request: in words; asked: the same as `Request.from_plain` reads it. tables: sha256 of the
    tables, by name (gait). margins: of limits and advice. nominal: numbers on the nominal robot. draws: of each quantity the
    quantiles 0, 5, 50, 95, 100 % over the ensemble (null where there are fewer than 20); falls, number of robots drawn, their
    incidents, and their residual heading after trimming. floor: change of speed and heading with step and contact model.
    other_engine: the same table in another simulator; empty where there was none. ways: start and stop. cycle: how
    steady the gait is from cycle to cycle, and after how many cycles it walks as before where it was entered otherwise or
    disturbed. provenance: versions, seeds, time.
    """

    kept: bool
    request: str
    tables: Mapping[str, str]
    model_sha256: str
    margins: tuple[Margin, ...]
    nominal: Nominal
    draws: Mapping[str, Any]
    floor: Mapping[str, Any]
    other_engine: Mapping[str, Any]
    ways: Ways
    cycle: Steadiness
    shape: Mapping[str, Any]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    asked: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Content of the file, in plain types, with the sha256 of all the rest."""
        records = {k: to_plain(getattr(self, k)) for k in RECORDS}
        content = plain({"format": 1, "claim": CLAIM, **{k: v for k, v in vars(self).items() if k != "margins"}, **records,
                         "margins": [vars(m) for m in self.margins]})
        return {**content, "sha256": _digest(content)}

    def as_text(self) -> str:
        """The file."""
        return json.dumps(self.to_json(), indent=1, allow_nan=False) + "\n"

    def summary(self) -> str:
        """The certificate in a few lines, for a person."""
        n, d = self.nominal, self.draws
        turns = n.unit == "rad/s"
        unit, factor = ("deg/s", 180 / math.pi) if turns else ("m/s", 1.0)
        nominal = f"{factor * n.speed:.3g} {unit} on the nominal robot of the model"
        lines = [f"{self.request}: {nominal}"]
        if d.get("count"):
            lowest, five = d[f"speed {n.unit}"][:2]
            low = f"lowest {factor * lowest:.3g}" if five is None else f"5th percentile {factor * five:.3g}"
            falls = f"{d['falls']} fell (probability of a fall below {100 * d['falls at most']:.2g} % at 95 % confidence)"
            lines = [f"{self.request}: {low} {unit} of {d['count']} sampled robots, {nominal}",
                     f"{falls}; heading drift {d['heading deg/m RMS']:.2g} deg/m RMS"]
            lines += _describe_straightening(d.get("straightened"))
            lines += [f"sample {i['draw']} ({i['robot']}): {i['what']}" for i in d["incidents"]]
        worst = max((m for m in self.margins if not m.advice), key=lambda m: m.use)
        lines.append(f"binding limit: {worst}")
        advice = max((m for m in self.margins if m.advice), key=lambda m: m.use, default=None)
        if advice is not None and advice.use > 1:
            lines.append(f"warning: {advice}; the servo heats up")
        if self.cycle.back:
            lines.append(_returns(self.cycle))
        if self.other_engine:
            e = self.other_engine
            apart = f"heading differs by {e['heading apart deg/m']:+.1f} deg/m"
            lines.append(f"{e['name']}: {100 * e['speed kept']:.0f} % of the speed, {apart}; over friction, supply and "
                         f"entry the speeds differ by at most {100 * e['largest speed apart']:.0f} %")
        return "\n".join(lines)


def _describe_straightening(found: Mapping[str, Any] | None) -> list[str]:
    """Residual heading after the recordings, in a line; empty where it was not examined."""
    if not found or found["after one metre deg/m RMS"] is None:
        return []
    one, three = found["after one metre deg/m RMS"], found["after 3 metres deg/m RMS"]
    return [f"straightened by `workbench trim`: {one:.2g} deg/m RMS after one recorded metre, {three:.2g} after three "
            f"({found['robots']} robots)"]


def _returns(cycle: Steadiness) -> str:
    """Whether the gait is one limit cycle, and how steady, in a line."""
    scatter = f"the heading scatters by {cycle.heading:.2g} deg from cycle to cycle"
    if cycle.lost:
        return f"does not return to its limit cycle: {', '.join(cycle.lost)}; {scatter}"
    return f"after another entry, a push or a missed pose it returns to its limit cycle within {cycle.slowest} cycles; {scatter}"


def read_certificate(path: str | Path) -> Certificate:
    """Reads the file; InputError where it is missing, not whole or was changed."""
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "the certificate is missing")
    content = read_json(path)
    if not isinstance(content, dict):
        raise InputError(path, f"not a certificate: expected a JSON object, got {_SHOWN[type(content)]}")
    if content.get("format") != 1:
        raise InputError(path, f"not a certificate: expected format 1, got {reprlib.repr(content.get('format'))}")
    needed = {k for k in Certificate.__dataclass_fields__ if k not in ADDED} | {"sha256"}
    if lacking := sorted(needed - set(content)):
        raise InputError(path, f"not a certificate as `workbench optimize` writes it: {lacking[0]} is missing")
    if content["sha256"] != _digest(content):
        raise InputError(path, "the certificate was changed after it was written")
    return _certificate(path, content)


def _certificate(path: Path, content: Mapping[str, Any]) -> Certificate:
    """The certificate of a JSON object; InputError names the field that is not as it is written."""
    fields: dict[str, Any] = {}
    for name in Certificate.__dataclass_fields__:
        if name not in content and name in ADDED:
            continue
        try:
            fields[name] = _field(name, content[name])
        except (ValueError, KeyError, TypeError, AttributeError):
            raise InputError(path, f"not a certificate as `workbench optimize` writes it: {name} has other content") from None
    return Certificate(**fields)


def _field(name: str, value: Any) -> Any:
    """A field of its type; ValueError, KeyError, TypeError or AttributeError where the value cannot be that."""
    if name == "margins":
        if not isinstance(value, list) or not value:
            raise TypeError(name)
        return tuple(Margin(**m) for m in value)
    if name in RECORDS:
        return from_plain(RECORDS[name], value)
    if not isinstance(value, _PLAIN.get(name, Mapping)):
        raise TypeError(name)
    return value


def certificate_beside(motion: str | Path) -> Certificate:
    """The certificate in the folder of a motion file, kept or not. InputError where one of the two is missing."""
    if not Path(motion).is_file():
        raise InputError(motion, "file not found")
    return read_certificate(Path(motion).parent / NAME)


def read_shape(motion: str | Path) -> GaitShape:
    """The shape in the certificate of a motion file, which lies in the same folder, kept or not. InputError where there is no
    such file, no certificate, or no shape in it."""
    at, certificate = Path(motion).parent / NAME, certificate_beside(motion)
    try:
        return GaitShape.from_plain(certificate.shape)
    except (KeyError, TypeError, ValueError):
        raise InputError(at, "expected a gait's shape, as `workbench optimize` writes it; make the gait again") from None


def has_mark(path: str | Path) -> bool:
    """Whether a motion file says that `optimize` made it."""
    file = Path(str(path).partition("#")[0])
    return file.is_file() and file.suffix.lower() == ".csv" and MARK in read_text(file).split("\n", 1)[0]


def check_certificate(path: str | Path, motion: Motion, model: RobotModel) -> Certificate:
    """The certificate in the folder of a motion file made by `optimize`; InputError where it is absent, another's, damaged, or
    reports a broken limit."""
    certificate = read_certificate(Path(path).parent / NAME)
    at = Path(path).parent / NAME
    check_table(certificate, path, motion)
    if certificate.model_sha256 != model.sha256:
        raise InputError(at, f"it was made for another robot ({certificate.model_sha256[:12]}) than this ({model.sha256[:12]})")
    if not certificate.kept:
        broken = max((m for m in certificate.margins if not m.advice), key=lambda m: m.use)
        raise InputError(at, f"it reports a broken limit: {broken}")
    return certificate


def check_table(certificate: Certificate, path: str | Path, motion: Motion) -> None:
    """InputError where a certificate is of another table than that of the motion file in its folder."""
    if table_sha256(motion.as_table()) not in certificate.tables.values():
        raise InputError(Path(path).parent / NAME, f"it is another table's than {Path(path).name}")


def hashes(**tables: PoseTable) -> dict[str, str]:
    """sha256 by name."""
    return {name: table_sha256(t) for name, t in tables.items()}


def _digest(content: Mapping[str, Any]) -> str:
    text = json.dumps(plain({k: v for k, v in content.items() if k != "sha256"}), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def plain(value: Any) -> Any:
    """Plain types, for JSON; unknown or unbounded values are null."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
