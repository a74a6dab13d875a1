"""What is to be run, said before anything is: factors, levels, seeds, and their hash."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from studies import inputs
from workbench.files import InputError
from workbench.files.reading import read_text, write_whole
from workbench.files.resources import resolve_model
from workbench.robot import data_file

FACTORS = ("masses", "friction", "step", "contact")
"""That the question names; `drive` is apart, each drive has a cloud of its own."""
CENTRE: Mapping[str, Any] = {"masses": "as built", "friction": 0.6, "step": 1e-3, "contact": "point"}
MASSES: Mapping[str, float | int] = {"-15 %": 0.85, "as built": 1.0, "+15 %": 1.15, "seed 1": 1}
"""All links by one factor (float), or each by a factor of its own from 0.85 to 1.15, drawn with a seed (int)."""
MASS_RANGE = (0.85, 1.15)
EXCURSIONS = ("speeds in the order of names", "supply 9 V", "friction 0.3", "friction 1.0")
"""One at a time from CENTRE, outside what the question names: what else could carry the rest."""


@dataclass(frozen=True)
class Case:
    """One run. excursion: one of EXCURSIONS, or nothing."""

    drive: str
    masses: str
    friction: float
    step: float
    contact: str
    excursion: str = ""


@dataclass(frozen=True)
class Design:
    """All of it. levels: by factor. seconds: of each run. inputs_sha256: of model, motion and how long."""

    levels: Mapping[str, tuple[Any, ...]]
    drives: tuple[str, ...]
    excursions: tuple[str, ...]
    seconds: float
    inputs_sha256: Mapping[str, str]

    @property
    def cases(self) -> list[Case]:
        """Every combination of levels for each drive, then the excursions."""
        crossed = [Case(drive, *combination) for drive in self.drives
                   for combination in itertools.product(*(self.levels[f] for f in FACTORS))]
        apart = [Case(drive, **CENTRE, excursion=what) for drive in self.drives for what in self.excursions
                 if drive == "servo" or what.startswith("friction")]
        return crossed + apart

    @property
    def text(self) -> str:
        """As JSON; the same design gives the same text."""
        return json.dumps({
            "question": "Six seconds of the ROBOTIS walk from rest: how far do distance and heading spread?",
            "seconds": self.seconds, "drives": list(self.drives), "levels": {k: list(v) for k, v in self.levels.items()},
            "masses": {"one factor for all links, or a seed for one each": dict(MASSES), "range": list(MASS_RANGE)},
            "excursions": list(self.excursions), "centre": dict(CENTRE), "runs": len(self.cases),
            "inputs_sha256": dict(self.inputs_sha256)}, indent=1, sort_keys=True) + "\n"

    @property
    def sha256(self) -> str:
        """Of the text."""
        return hashlib.sha256(self.text.encode()).hexdigest()


def make_design(description: str, quick: bool) -> Design:
    """The full design, or a corner of it."""
    files = {"model": resolve_model(description), "motion": data_file("robotis_walk.csv")}
    hashes = {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in files.items()}
    levels: dict[str, tuple[Any, ...]] = {
        "masses": ("-15 %", "+15 %", "seed 1"), "friction": (0.5, 0.6, 0.7), "step": (2e-3, 1e-3, 5e-4),
        "contact": ("point", "hydroelastic")}
    if quick:
        levels |= {"masses": ("as built", "seed 1"), "friction": (0.5, 0.7), "step": (2e-3,), "contact": ("point",)}
    return Design(levels, ("servo", "ideal"), EXCURSIONS[:1] if quick else EXCURSIONS, 0.2 if quick else inputs.SECONDS, hashes)


def state(design: Design, folder: Path) -> Path:
    """Writes design.json, before any run."""
    return write_whole(folder / "design.json", design.text)


def with_masses(description: str, masses: str, folder: Path) -> str:
    """The same robot with other masses, as an SDF in `folder`; inertias scale with their link's mass. Returns its path."""
    text = read_text(resolve_model(description))
    blocks = re.findall(r"<inertial>.*?</inertial>", text, flags=re.DOTALL)
    if not blocks:
        raise InputError(description, "expected links with <inertial>")
    factors = iter(mass_factors(masses, len(blocks)))

    def scaled(block: re.Match[str]) -> str:
        factor = float(next(factors))
        return re.sub(r"(<(mass|i[xyz]{2})>)([^<]+)(</)", lambda m: f"{m[1]}{float(m[3]) * factor:.9g}{m[4]}", block[0])

    changed = re.sub(r"<inertial>.*?</inertial>", scaled, text, flags=re.DOTALL)
    return str(write_whole(folder / f"masses_{list(MASSES).index(masses)}.sdf", changed))


def mass_factors(masses: str, links: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Factor of each link, in the file's order."""
    level = MASSES[masses]
    if isinstance(level, float):
        return np.full(links, level)
    return np.random.default_rng(level).uniform(*MASS_RANGE, links)
