"""The robots that a gait must stand: random draws of a file, or of the posterior of a diagnosis."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench.effects.registry import effect_named
from workbench.effects.sdf import SdfRobot
from workbench.effects.sdf_values import read_inertia, write_inertia
from workbench.files.reading import write_whole
from workbench.files.yaml_file import Fields, read_yaml
from workbench.gait.legs import legs_of
from workbench.physical import MASS
from workbench.robot import EffectSpec, RobotModel, data_file
from workbench.robot.model_file import Posterior, parameter_names

BUNDLED = "gait_ensemble.yaml"
RANGES = ("friction", "supply_voltage", "supply_sag", "backlash", "command_delay")
"""Keys of the file that hold `low` and `high`."""
EFFECTS = {"friction": ("ground_friction", "friction"), "supply_voltage": ("supply_voltage", "voltage"),
           "supply_sag": ("supply_sag", "drop"), "backlash": ("backlash", "gap"), "command_delay": ("command_delay", "delay")}
"""The effect and the parameter that each range is of, in the units of docs/formats.md, section 7."""
EACH_SERVO = ("backlash", "command_delay")
EVERYWHERE = ""
"""Place of an effect that names none: the ground, the supply, or every servo."""


@dataclass(frozen=True)
class Ensemble:
    """Robots that this one may be, from which a gait is tested on random draws.

    ranges: low and high of uniform draws, by key: "friction" (of foot on ground), "supply_voltage" [V], "supply_sag" [V for each
    servo at full duty], "backlash" [deg] of each leg's joint and "command_delay" [s] of each servo. mass_share: half width of a
    uniform draw of each link's mass, as a share of it. payload: a mass [kg] at a random point of the base link. zero_sd: standard
    deviation of the zero of each leg's joint [deg]. posterior: of a diagnosed model, whose parameters are drawn too, in place of
    the range of the same effect at the same place; elsewhere the range stays. source: file, for messages.
    """

    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    mass_share: float = 0.0
    payload: float = 0.0
    zero_sd: float = 0.0
    posterior: Posterior | None = None
    source: str = "ensemble"

    def draws(self, model: RobotModel, count: int, seed: int, folder: Path, even: bool = False) -> list[RobotModel]:
        """`count` robots, the same for the same seed. Robots whose links' masses differ are written into `folder` as SDF
        files of their own; parameters of a diagnosed model's effects are drawn from its posterior, the rest is added to it.
        even: whether floor and supply are spread evenly over their ranges, one robot in each of `count` equal parts (a Latin
        hypercube), so that a few robots show both ends; such draws are not independent, so that counts of them have no
        confidence bound."""
        rng = np.random.default_rng([seed, 20])
        legs = sorted({j for leg in legs_of(model) for j in leg.joints}) if count else []
        spread: list[dict[str, float]] = self._spread(count, seed) if even else [{} for _ in range(count)]
        return [self._draw(model, legs, rng, folder, values) for values in spread]

    def _spread(self, count: int, seed: int) -> list[dict[str, float]]:
        """For each of `count` robots the value of every range that is the same for all its servos."""
        rng = np.random.default_rng([seed, 21])
        out: list[dict[str, float]] = [{} for _ in range(count)]
        for key, (low, high) in self.ranges.items():
            if key not in EACH_SERVO:
                for values, place in zip(out, (rng.permutation(count) + rng.uniform(size=count)) / max(count, 1)):
                    values[key] = float(low + (high - low) * place)
        return out

    @property
    def sha256(self) -> str:
        """Digest of everything that the ensemble draws from."""
        content = [sorted(self.ranges.items()), self.mass_share, self.payload, self.zero_sd]
        if self.posterior is not None:
            content += [list(self.posterior.names), np.asarray(self.posterior.mean).tolist(),
                        np.asarray(self.posterior.covariance).tolist()]
        return hashlib.sha256(repr(content).encode()).hexdigest()

    def _draw(self, model: RobotModel, legs: list[str], rng: np.random.Generator, folder: Path,
              values: Mapping[str, float]) -> RobotModel:
        """values: of ranges, instead of random ones."""
        drawn = model if self.posterior is None else _from_posterior(model, self.posterior, rng)
        effects: list[EffectSpec] = []
        for key, (low, high) in self.ranges.items():
            name, parameter = EFFECTS[key]
            if key in EACH_SERVO:
                joints = legs if key == "backlash" else list(model.joints)
                effects += [EffectSpec(name, (j,), {parameter: float(rng.uniform(low, high))}) for j in joints]
            else:
                value = float(rng.uniform(low, high))  # drawn in any case: the robot's other numbers stay the same
                effects.append(EffectSpec(name, (), {parameter: values.get(key, value)}))
        if self.zero_sd:
            effects += [EffectSpec("zero_offset", (j,), {"angle": float(self.zero_sd * rng.standard_normal())}) for j in legs]
        if self.payload:
            x, y, z = _inside(model, rng)
            effects.append(EffectSpec("payload", (model.base,), {"mass": self.payload, "position": (x, y, z)}))
        if self.mass_share:
            factors = {link: float(1 + self.mass_share * rng.uniform(-1, 1)) for link in model.kinematics.links}
            drawn = with_masses(drawn, factors, folder)
        known = {(e.effect, place) for e in model.effects for place in e.where or (EVERYWHERE,)}
        return drawn.with_effects((*drawn.effects, *(e for e in effects if not _is_diagnosed(e, known))))


def with_masses(model: RobotModel, factors: Mapping[str, float], folder: Path) -> RobotModel:
    """The robot with each link's mass and inertia times its factor, as an SDF file in `folder` named by its content."""
    sdf, masses = SdfRobot(model.path), dict(model.kinematics.masses)
    for link, factor in factors.items():
        inertial = sdf.inertial(link)
        mass, center, inertia = read_inertia(inertial)
        write_inertia(inertial, mass * factor, center, inertia * factor)
        masses[link] *= factor
    text = sdf.text()
    path = folder / f"masses-{hashlib.sha256(text.encode()).hexdigest()[:12]}.sdf"
    if not path.is_file():
        write_whole(path, text)
    return model.with_masses(path, masses)


MOST_SHARE = 0.9
"""By which the mass of a link may vary: at 1, a link may have none."""
MOST_ZERO = 15.0
"""Standard deviation of a zero [deg]: at three of them, a horn sits two teeth off."""


def load_ensemble(path: str | Path | None = None, posterior: Posterior | None = None) -> Ensemble:
    """Reads the file (default: the bundled one). InputError names file, key and the expected value."""
    path = data_file(BUNDLED) if path is None else Path(path)
    top = Fields(path, read_yaml(path))
    if top.raw("format") != 1:
        raise top.error("format", "expected 1")
    ranges = {}
    for key in RANGES:
        f = top.mapping(key)
        if f is not None:
            low, high = (float(f.required(k, f.number(k, least=0))) for k in ("low", "high"))
            if high < low:
                raise f.error("high", f"expected at least {low:g}, got {high:g}")
            _check_bounds(f, key, low, high)
            f.done()
            ranges[key] = (low, high)

    def one(key: str, name: str, most: float) -> float:
        f = top.mapping(key)
        if f is None:
            return 0.0
        value = float(f.required(name, f.number(name, least=0, most=most)))
        f.done()
        return value

    mass, zero = one("link_mass", "share", MOST_SHARE), one("zero_offset", "sd", MOST_ZERO)
    payload = one("payload", "mass", MASS.most)
    top.done()
    return Ensemble(ranges, mass, payload, zero, posterior if posterior is not None and posterior.names else None, str(path))


def _check_bounds(f: Fields, key: str, low: float, high: float) -> None:
    """InputError where a range exceeds what the effect that it draws can have."""
    name, parameter = EFFECTS[key]
    p = next(p for p in effect_named(name).parameters if p.name == parameter)
    for bound, value in (("low", low), ("high", high)):
        if not p.low <= value <= p.high:
            raise f.error(bound, f"expected {p.low:g} to {p.high:g} {p.unit.removeprefix('1')}".rstrip() + f", got {value:g}")


def _is_diagnosed(drawn: EffectSpec, known: set[tuple[str, str]]) -> bool:
    """Whether a diagnosis found this effect at this place: there it is better known than the file's range, and nowhere else."""
    return (drawn.effect, EVERYWHERE) in known or any((drawn.effect, place) in known for place in drawn.where)


def _from_posterior(model: RobotModel, posterior: Posterior, rng: np.random.Generator) -> RobotModel:
    """The diagnosed model with its effects' parameters drawn jointly, kept within the effects' bounds."""
    assert list(posterior.names) == list(parameter_names(model.effects))
    known_well = np.isfinite(np.diag(posterior.covariance))  # what the data say nothing about stays at its mean
    covariance = np.where(np.outer(known_well, known_well), posterior.covariance, 0.0)
    values = iter(rng.multivariate_normal(np.asarray(posterior.mean), covariance, method="eigh").tolist())
    drawn = model.with_effects(())
    for spec in model.effects:
        effect = effect_named(spec.effect)
        ends = {p.name: (low, p.high) for p, low in zip(effect.parameters, effect.lowest(drawn, spec.where))}
        numbers: dict[str, Any] = {}
        for name, value in spec.parameters.items():
            if isinstance(value, tuple):
                numbers[name] = tuple(float(np.clip(next(values), *ends[name])) for _ in value)
            else:
                numbers[name] = float(np.clip(next(values), *ends[name]))
        drawn = drawn.with_effects((*drawn.effects, replace(spec, parameters=numbers)))
    return drawn


def _inside(model: RobotModel, rng: np.random.Generator) -> tuple[float, float, float]:
    """A point anywhere in the box that spans the base link's joints and centre of mass [m], in its frame."""
    k = model.kinematics
    places = [k.centers[model.base], *(f.X_PF_p for f in k.frames.values() if f.parent == model.base)]
    low, high = np.min(places, axis=0), np.max(places, axis=0)
    x, y, z = rng.uniform(low, high)
    return float(x), float(y), float(z)
