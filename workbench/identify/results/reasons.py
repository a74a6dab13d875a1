"""Why an effect was rejected, and which signal a residual correlates with: typed values, with words for a file or a person."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from workbench.compare.channels import ACROSS, BODY

Naming = Callable[[str, Sequence[str]], str]
"""How the reader wants an effect at a place called."""
Signal = Literal["time", "angle", "size of the angle", "speed", "direction of motion"]
"""Signals with which a residual may be correlated."""


def effect_at(effect: str, where: Sequence[str]) -> str:
    """Name of an effect at its place, as in findings.json: "backlash(flm)"."""
    return f"{effect}({','.join(where)})"


MANY = math.log(1e6)
"""Factors beyond a million are of no account [nats]."""


class Statement(ABC):
    """Something that is said in findings.json and in the report."""

    @abstractmethod
    def in_words(self, naming: Naming = effect_at) -> str:
        """The statement in words, without a full stop, effects named by `naming`."""

    def __str__(self) -> str:
        return self.in_words()


class Reason(Statement):
    """Why an effect that was tried is not kept."""

    of_chi_squared: ClassVar[bool] = False
    """Whether it mentions chi squared, which a report has to explain."""


@dataclass(frozen=True)
class WorseInPlace(Reason):
    """Fitted in the place of an effect that was found, it leaves `behind` more of chi squared on stretches that no fit saw."""

    of_chi_squared: ClassVar[bool] = True
    effect: str
    where: tuple[str, ...]
    behind: float

    def in_words(self, naming: Naming = effect_at) -> str:
        more = f"{self.behind:.0f} higher" if self.behind >= 0 else f"only {-self.behind:.0f} lower"
        return f"in place of {naming(self.effect, self.where)} it leaves chi squared {more} on held-out stretches"


@dataclass(frozen=True)
class ScreenedOut(Reason):
    """Rejected by its response alone, without a fit: the largest possible reduction of chi squared, `gain`, and that of the best
    rival, `best`, on the stretches that were used."""

    gain: float
    best: float

    def in_words(self, naming: Naming = effect_at) -> str:
        takes = f"reduces chi squared by {self.gain:.0f} at most" if self.gain >= 1 else "does not reduce chi squared"
        return f"its response does not match the residuals: it {takes}, the best competing effect by {self.best:.0f}"


@dataclass(frozen=True)
class TooLittle(Reason):
    """Nothing was accepted at this joint or link."""

    def in_words(self, naming: Naming = effect_at) -> str:
        return "it reduces the error no more than chance would, or removes too little of the excess error there"


@dataclass(frozen=True)
class Outdone(Reason):
    """Another effect reduced chi squared by more: `taken`, this one by `gain`."""

    of_chi_squared: ClassVar[bool] = True
    effect: str
    where: tuple[str, ...]
    taken: float
    gain: float

    def in_words(self, naming: Naming = effect_at) -> str:
        return (f"{naming(self.effect, self.where)} reduces chi squared by {self.taken:.0f} on the stretches that decide between "
                f"effects, this one by {self.gain:.0f}")


@dataclass(frozen=True)
class LessLikely(Reason):
    """The most probable model with it is `behind` [nats] in log posterior."""

    behind: float

    def in_words(self, naming: Naming = effect_at) -> str:
        return f"the best model containing it is {_times(self.behind)} less probable"


@dataclass(frozen=True)
class SpokenAgainst(Reason):
    """Held-out takes are less probable with it, by so many nats."""

    by: float

    def in_words(self, naming: Naming = effect_at) -> str:
        return f"with it, the held-out takes are {_times(self.by)} less probable"


@dataclass(frozen=True)
class RefutedByRegister(Reason):
    """Value of its parameter in the servo's own register, and the standard error, in `unit`."""

    parameter: str
    value: float
    error: float
    unit: str

    def in_words(self, naming: Naming = effect_at) -> str:
        value = f"{self.value:.3g} ± {self.error:.2g}{_behind_number(self.unit)}"
        return f"the servos' own registers show that {self.parameter} is {value}"


@dataclass(frozen=True)
class AtItsEnd(Reason):
    """The fit took its parameter to the largest plausible value on this robot, `value` in `unit`."""

    parameter: str
    value: float
    unit: str

    def in_words(self, naming: Naming = effect_at) -> str:
        value = f"{self.value:.3g}{_behind_number(self.unit)}"
        return f"its {self.parameter} would have to be {value} or beyond, which is not plausible for this robot"


def _times(nats: float) -> str:
    """A difference of log probability as a factor."""
    if nats > MANY:
        return f"more than {math.exp(MANY):,.0f} times"
    return f"{math.exp(max(nats, 0.0)):.2g} times" if nats < math.log(100) else f"{float(f'{math.exp(nats):.1g}'):,.0f} times"


def _behind_number(unit: str) -> str:
    """A unit with the space before it; nothing for a ratio."""
    return "" if unit in ("", "1") else f" {unit}"


class Description(Statement):
    """Appearance of an unexplained residual."""


@dataclass(frozen=True)
class Dependence(Description):
    """A channel's residual in a take, and the signal it correlates with; None: with none that was tested. worst: the event where
    it is largest, in words."""

    take: str
    channel: str
    signal: Signal | None = None
    correlation: float = 0.0
    worst: str = ""

    def in_words(self, naming: Naming = effect_at) -> str:
        what = (f"{self.channel}, " if self.channel in BODY else
                f"across its axis ({self.channel}), " if ACROSS in self.channel else "")
        goes = "no correlation with any tested signal" if self.signal is None else (
            f"correlates with {self.signal} ({self.correlation:.2f})")
        return f"{self.take}: {self.worst}{'; ' if self.worst else ''}{what}{goes}"


@dataclass(frozen=True)
class ParameterDrift(Description):
    """A parameter that would have to change within a take, from `first` to `last`, in `unit`."""

    effect: str
    where: tuple[str, ...]
    parameter: str
    first: float
    last: float
    unit: str

    def in_words(self, naming: Naming = effect_at) -> str:
        return (f"{self.parameter} of {naming(self.effect, self.where)} would have to change from {self.first:.3g} to "
                f"{self.last:.3g} {self.unit} within a take: the cause may be something that varies with time")


@dataclass(frozen=True)
class DownwardPull(Description):
    """A force on the base that points straight down, with the weight of `mass` [kg]."""

    effect: str
    mass: float

    def in_words(self, naming: Naming = effect_at) -> str:
        return (f"the {self.effect.replace('_', ' ')} is a vertical pull of {1e3 * self.mass:.0f} g, but without the inertia of "
                "a load: the cause may be something that hangs and swings")
