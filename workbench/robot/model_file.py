"""`model.yaml`: a robot with the physics found missing in it, for this workbench and for any other Drake project.

`MakeStation(load_model("model.yaml"))` simulates it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import InputError
from workbench.files.reading import write_whole
from workbench.files.yaml_file import Fields, top_of, yaml_text
from workbench.robot.model import EffectSpec, RobotModel
from workbench.robot.mounting import written_mountings
from workbench.robot.robot_section import check_protocol, read_model, read_servos
from workbench.robot.servo_profile_file import servo_profile
from workbench.types import Array

_EDITED = "where an effect was edited, delete `posterior`, which is of the effects as they were fitted"
_SAME = 1e-6
"""Relative difference of numbers that are the same; files have them with six digits and more."""


@dataclass(frozen=True)
class Posterior:
    """Posterior of the effects' parameters, in the units of docs/formats.md, section 7.

    names: (n) such as "backlash(flm).gap", "payload(body_link).position.x". mean: (n,). covariance: (n, n), infinite where
    the data do not constrain them.
    """

    names: tuple[str, ...] = ()
    mean: Array = field(default_factory=lambda: np.zeros(0))
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        n = len(self.names)
        if np.shape(self.mean) != (n,) or np.shape(self.covariance) != (n, n):
            got = f"{np.shape(self.mean)}, {np.shape(self.covariance)}"
            raise InputError(None, f"posterior: expected mean ({n},) and covariance ({n}, {n}), got {got}")

    def in_order(self, effects: Sequence[EffectSpec]) -> Posterior:
        """The same, in the order of these effects, as a model.yaml with them has it. Numbers of one name (a payload that the
        nominal robot has, and one that was found) keep the order among them."""
        left = list(range(len(self.names)))
        at = []
        for name in parameter_names(effects):
            k = next((k for k in left if self.names[k] == name), None)
            if k is not None:
                left.remove(k)
                at.append(k)
        return Posterior(tuple(self.names[k] for k in at), np.asarray(self.mean)[at], np.asarray(self.covariance)[np.ix_(at, at)])


@dataclass(frozen=True)
class ModelFile:
    """The content of a model.yaml."""

    model: RobotModel
    posterior: Posterior
    provenance: Mapping[str, Any]


def parameter_names(effects: Sequence[EffectSpec]) -> tuple[str, ...]:
    """Names for a posterior, one for each number, in the effects' order."""
    out = []
    for e in effects:
        at = f"{e.effect}({','.join(e.where)})" if e.where else e.effect
        for name, value in e.parameters.items():
            out += [f"{at}.{name}.{axis}" for axis in "xyz"] if isinstance(value, tuple) else [f"{at}.{name}"]
    return tuple(out)


def save_model(model: RobotModel, path: str | Path, posterior: Posterior | None = None,
               provenance: Mapping[str, Any] | None = None) -> Path:
    """Writes model.yaml atomically; returns its path. posterior: of the effects' parameters, provenance: how they were found;
    both are kept for the reader and do not affect simulation. InputError if it cannot be written."""
    return write_whole(path, model_text(model, Path(path).parent, posterior, provenance))


def model_text(model: RobotModel, folder: Path, posterior: Posterior | None = None,
               provenance: Mapping[str, Any] | None = None) -> str:
    """The text of a model.yaml that is to lie in `folder`: an SDF inside that is named relative to it, another absolutely."""
    content = {"format": 1} | robot_content(model, folder)
    content["servos"] = content["robot"].pop("servos")
    if model.effects:
        content["effects"] = [_effect_content(e) for e in model.effects]
    if posterior is not None and posterior.names:
        content["posterior"] = {"names": list(posterior.names), "mean": np.asarray(posterior.mean, dtype=float).tolist(),
                                "covariance": np.asarray(posterior.covariance, dtype=float).tolist()}
    if provenance:
        content["provenance"] = dict(provenance)
    return yaml_text(content)


def robot_content(model: RobotModel, folder: Path) -> dict[str, Any]:
    """The keys `robot` and `ground` of a file in `folder`, without effects. Identical servos are written once; paths outside the
    folder are absolute."""
    servos = {j: model.servo(j).as_dict() for j in model.joints}
    robot: dict[str, Any] = {
        "model": _description(model, folder.resolve()), "base": model.base,
        "servos": next(iter(servos.values())) if len({repr(s) for s in servos.values()}) == 1 else servos,
        "rigid_bodies": dict(model.rigid_bodies), "bus_ids": dict(model.bus_ids)}
    robot |= written_mountings(model.mountings, {j: servo_profile(model.servo(j).model) for j in model.mountings})
    if model.packages:
        robot["packages"] = {name: str(Path(place).resolve()) for name, place in model.packages.items()}
    if model.feet is not None:
        robot["feet"] = list(model.feet)
    if model.held:
        robot["held"] = True
    return {"robot": robot, "ground": {k: v for k, v in asdict(model.ground).items() if v is not None}}


def _effect_content(e: EffectSpec) -> dict[str, Any]:
    parameters = {k: [float(x) for x in v] if isinstance(v, tuple) else float(v) for k, v in e.parameters.items()}
    return {"effect": e.effect, "where": list(e.where), "parameters": parameters}


def _description(model: RobotModel, folder: Path) -> str:
    if model.description.startswith("package://"):
        return model.description
    path = model.source.source
    return str(path.relative_to(folder) if path.is_relative_to(folder) else path)


def load_model(path: str | Path) -> RobotModel:
    """The robot of a model.yaml, with its effects."""
    return load_model_file(path).model


def load_model_file(path: str | Path) -> ModelFile:
    """Reads a model.yaml.

    InputError names the file, the key and the expected value: an unknown key, a missing SDF, an effect at a place that the robot
    lacks. The effects package checks whether an effect of that name is installed, and its parameters.
    """
    path = Path(path)
    top = top_of(path, "robot", "ground", "servos", "effects", "posterior", "provenance")
    model = read_model(top)
    model = replace(model, servos={**model.servos, **read_servos(top, model.joints)},
                    effects=tuple(_effect(f, model) for f in top.sequence("effects")))
    check_protocol(Fields(path, {}, "robot"), model.bus_ids, model.servos)
    posterior = _posterior(top.mapping("posterior"), model)
    given = top.mapping("provenance")
    provenance = {} if given is None else dict(given.items())
    top.done()
    return ModelFile(model, posterior, provenance)


def _effect(f: Fields, model: RobotModel) -> EffectSpec:
    f.only("effect", "where", "parameters")
    name = str(f.required("effect", f.text("effect")))
    where = f.raw("where") or []
    places = {*model.joints, *model.kinematics.links, *model.rigid_bodies}
    if not isinstance(where, list):
        raise f.error("where", f"expected a list of names, got {where!r}")
    for place in where:
        if not isinstance(place, str) or place not in places:
            raise f.error("where", f"the robot has no joint, link or rigid body '{place}'")
    given = f.mapping("parameters")
    parameters = {} if given is None else {key: _value(given, key, value) for key, value in given.items()}
    f.done()
    return EffectSpec(name, tuple(where), parameters)


def _value(f: Fields, key: str, value: Any) -> float | tuple[float, float, float]:
    if isinstance(value, list):
        numbers = _numbers(f, key, value, finite=True)
        if len(numbers) != 3:
            raise f.error(key, f"expected one number or three, got {len(numbers)}")
        return (numbers[0], numbers[1], numbers[2])
    return _numbers(f, key, [value], finite=True)[0]


def _posterior(f: Fields | None, model: RobotModel) -> Posterior:
    if f is None:
        return Posterior()
    f.only("names", "mean", "covariance")
    names, mean, covariance = (f.raw(key) for key in ("names", "mean", "covariance"))
    f.done()
    expected = list(parameter_names(model.effects))
    if names != expected:
        raise f.error("names", f"expected those of the effects, {', '.join(expected) or 'none'}; {_EDITED}")
    if not isinstance(mean, list) or len(mean) != len(expected):
        raise f.error("mean", f"expected a list of {len(expected)} numbers")
    means = _numbers(f, "mean", mean)
    values = [float(v) for e in model.effects for value in e.parameters.values() for v in np.ravel(value)]
    for name, value, there in zip(expected, values, means):
        if not math.isclose(value, there, rel_tol=_SAME, abs_tol=_SAME * 1e-3):
            raise f.error("mean", f"expected {value:g} of {name}, as the effect has it, got {there:g}; {_EDITED}")
    return Posterior(tuple(expected), np.array(means), _covariance(f, covariance, expected))


def _covariance(f: Fields, content: Any, names: Sequence[str]) -> Array:
    """The covariance (n, n) of these numbers, infinite where nothing is known of them."""
    n = len(names)
    if not isinstance(content, list) or len(content) != n or any(not isinstance(row, list) or len(row) != n for row in content):
        raise f.error("covariance", f"expected {n} rows of {n} numbers")
    rows = np.array([_numbers(f, "covariance", row) for row in content]).reshape(n, n)
    for name, variance in zip(names, np.diag(rows)):
        if variance < 0:
            raise f.error("covariance", f"expected a variance of {name}, got {variance:g}")
    finite = np.where(np.isfinite(rows), rows, 0.0)
    most = float(np.abs(finite).max(initial=0.0))
    if not np.allclose(rows, rows.T, rtol=_SAME, atol=_SAME * most):
        raise f.error("covariance", "expected the same numbers across the diagonal")
    scale = np.sqrt(np.where(np.diag(finite) > 0, np.diag(finite), 1.0))
    if n and float(np.linalg.eigvalsh(finite / np.outer(scale, scale))[0]) < -_SAME * n:
        raise f.error("covariance", "expected no negative variance in any direction")
    return rows


def _numbers(f: Fields, key: str, values: Sequence[Any], finite: bool = False) -> list[float]:
    for v in values:
        good = isinstance(v, (int, float)) and not isinstance(v, bool) and not math.isnan(v) and not (finite and math.isinf(v))
        if not good:
            raise f.error(key, f"expected a number, got {v!r}")
    return [float(v) for v in values]
