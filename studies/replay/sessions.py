"""Sessions of known truth, the same for every replay: drawn by a fixed seed, and the practice sessions where they are there."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studies.concealed_effects.generator import write_session
from studies.concealed_effects.plan import SessionPlan, plan_sessions
from studies.concealed_effects.score import SIZE
from workbench.effects.registry import effect_named
from workbench.files.reading import read_text

SEED, COUNT = 20_261_127, 22
"""Of the drawn sessions: no trial's, as a trial draws its own."""
PRACTICE = Path(__file__).resolve().parents[3] / "shared" / "practice"


@dataclass(frozen=True)
class KnownSession:
    """session: session.yaml. truth: as the trial seals it."""

    name: str
    session: Path
    truth: dict[str, Any]


def known_sessions(folder: Path, count: int = COUNT, say: Callable[[str], None] = print) -> list[KnownSession]:
    """The practice sessions, then `count` drawn ones, which are made in `folder` where they are not there yet: a minute each."""
    practice = [KnownSession(p.name, p / "session.yaml", _truth_of_practice(p))
                for p in sorted(PRACTICE.glob("*")) if (p / "session.yaml").exists()]
    drawn = []
    for plan in plan_sessions(SEED, COUNT)[:count]:
        if not (folder / plan.name / "truth.json").exists():
            say(f"making session {plan.name}")
            _make(folder, plan)
        drawn.append(KnownSession(plan.name, folder / plan.name / "session.yaml",
                                  json.loads(read_text(folder / plan.name / "truth.json"))))
    return practice + drawn


def _make(folder: Path, plan: SessionPlan) -> None:
    """Whole or not at all."""
    part = folder / f".{plan.name}.part"
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    shown, sealed = write_session(part, plan)
    for name, text in (shown | {"truth.json": sealed["truth.json"]}).items():
        (part / name).parent.mkdir(parents=True, exist_ok=True)
        (part / name).write_text(text, encoding="utf-8")
    shutil.rmtree(folder / plan.name, ignore_errors=True)
    os.replace(part, folder / plan.name)


def _truth_of_practice(folder: Path) -> dict[str, Any]:
    """In the trial's words: there a place is by its kind, and a size in SI."""
    truth = json.loads(read_text(folder / "answer" / "truth.json"))
    effects = []
    for e in truth["effects"]:
        where = [e[kind] for kind in ("joint", "foot", "link") if kind in e]
        sizes = {p.name: e["value"] / p.si for p in effect_named(e["effect"]).parameters if p.name == SIZE[e["effect"]]}
        effects.append({"effect": e["effect"], "where": where, "parameters": sizes})
    return {"name": folder.name, "robot": "quadruped", "masked": False, "outside": [], "effects": effects, "takes": {}}
