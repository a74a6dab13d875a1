"""Known changes of the weighed STS3215 rig, diagnosed from one session alone and with the law of another session.

    python -m studies.sts3215 --data ../shared/data/sts3215 --out OUT [--quick] [--only NAME ...]

For each session: effects with confidence, estimated and true size, and time. With the law of another session, the first
repetition of the rig as weighed is diagnosed first, and the others are compared with its model.yaml (`diagnose --model`).
Frequencies and sizes are those of one servo; nothing in the diagnosis was set on them.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from studies.common import ROOT, run_study
from studies.sts3215.sessions import CASES, SPLITS, Case, is_recorded, write_session
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.identify.diagnosis import diagnose_session
from workbench.identify.results.findings import Diagnosis, Finding
from workbench.identify.results.servo_law import GravityOverTorque
from workbench.robot import RobotModel, load_model
from workbench.types import Progress

SAID = 0.5
"""Confidence from which on a name counts."""
QUICK: dict[str, Any] = {"gains": (16,), "programmes": ("sin_sin",)}
QUICK_CASES = ("quiet", "mass")
"""What of a session, and which sessions, the quick form looks at: whether it runs, not how good it is."""
DATA = ROOT / "../shared/data/sts3215"
ALONE, SINCE = "alone", "since another session"


@dataclass(frozen=True)
class Outcome:
    """Of one session. rightly: the change was named, alone or in its tie, or, where there is none, nothing; named: alone; false:
    names that are wrong; value: the estimated size, and `sized` whether it is as close to the truth as the case demands, None
    without an estimate; seconds: of processor."""

    case: str
    since: str
    findings: tuple[Finding, ...]
    tied: tuple[GravityOverTorque, ...]
    rightly: bool
    named: bool
    false: tuple[str, ...]
    value: float | None
    sized: bool | None
    seconds: float

    def to_json(self) -> dict[str, object]:
        """As it is kept."""
        return {"case": self.case, "since": self.since, "rightly": self.rightly, "named": self.named, "false": list(self.false),
                "value": self.value, "sized": self.sized, "seconds": round(self.seconds, 1),
                "findings": [f.to_json() for f in self.findings], "tied": [t.to_json() for t in self.tied]}


def judged(case: Case, diagnosis: Diagnosis, since: str, seconds: float) -> Outcome:
    """A diagnosis compared with the truth."""
    said = [f for f in diagnosis.findings if f.confidence >= SAID]
    named = [f for f in said if f.effect in case.effects]
    false = tuple(f.effect for f in said if f.effect not in case.effects)
    if case.loaded is None:
        ties = [t for t in diagnosis.tied
                if {n.effect for n in t.competitive} & set(case.effects) and (t.confidence >= SAID or not t.since)]
        measured = [t for t in ties if t.since]
    else:  # the known weight leaves the servo's torques as the only cause
        measured = ties = [t for t in diagnosis.tied if t.may_be_torque and not t.competitive]
    size, value = None, None
    if case.moment is not None:
        value = next((float(t.ratio.value) for t in measured), None)  # type: ignore[arg-type]
        size = None if value is None else abs(value - case.moment) <= case.within * abs(case.moment - 1.0)
    elif named:
        value = next((float(v.value) for v in named[0].parameters.values() if not isinstance(v.value, tuple)), None)
        size = None if value is None else abs(value - case.size) <= case.within * abs(case.size)
    if case.loaded is not None:
        rightly = not said and bool(ties)
    elif case.effects:
        rightly = bool(named or ties)
    else:
        rightly = not said and not any(t.since for t in diagnosis.tied)
    return Outcome(case.name, since, diagnosis.findings, diagnosis.tied, rightly, bool(named), false, value, size, seconds)


def diagnosed(case: Case, data: Path, folder: Path, previous: RobotModel | None, since: str, jobs: int,
              progress: Progress, memory: Path | None = None) -> Outcome:
    """A session written, diagnosed and saved."""
    session = load_session(write_session(folder, data, case))
    began = time.process_time()
    result = diagnose_session(session, progress, jobs, memory=memory, previous=previous)
    result.diagnosis.save(folder / "diagnosis")
    outcome = judged(case, result.diagnosis, since, time.process_time() - began)
    print(f"{case.name} ({since}): {'right' if outcome.rightly else 'WRONG'}, {outcome.seconds:.0f} s", flush=True)
    for f in result.diagnosis.findings:
        sizes = ", ".join(f"{k} {_told(e.value)} ({_told(e.low)} to {_told(e.high)})" for k, e in f.parameters.items())
        print(f"    {f.confidence:.2f} {f.effect}: {sizes}", flush=True)
    for t in result.diagnosis.tied:
        print(f"    {t.confidence:.2f} {t.in_words()}", flush=True)
    return outcome


def _told(value: float | tuple[float, ...]) -> str:
    return "[" + " ".join(f"{v:.3g}" for v in value) + "]" if isinstance(value, tuple) else f"{value:.3g}"


def study(args: argparse.Namespace, out: Path, quick: bool, progress: Progress) -> str:
    """All sessions alone, then all with the law of the first."""
    if unknown := set(args.only) - {c.name for c in CASES}:
        raise InputError(None, f"--only: no session is named {min(unknown)!r}; expected of {', '.join(c.name for c in CASES)}")
    if args.memory is not None:
        args.memory.mkdir(parents=True, exist_ok=True)
    cases = [replace(c, **QUICK) for c in CASES if c.name in QUICK_CASES] if quick else list(CASES)
    law, outcomes = args.law, []
    if law is None:
        outcomes.append(diagnosed(cases[0], args.data, out / "law", None, ALONE, args.jobs, progress, args.memory))
        law = out / "law" / "diagnosis" / "model.yaml"
    known = load_model(law)
    wanted = [c for c in cases[1:] if not args.only or c.name in args.only]
    if not quick:
        wanted = [replace(c, name=f"{c.name}, {split}", programmes=SPLITS[split]) for split in args.splits for c in wanted]
        wanted = [c for c in wanted if is_recorded(args.data, c)]
    for case in wanted:
        ways = ((known, SINCE), (None, ALONE))[:1 if args.since_only else 2] if case.loaded is None else ((None, ALONE),)
        for previous, since in ways:
            folder = out / f"{case.name.replace(', ', '_')}_{'since' if previous else 'alone'}"
            outcomes.append(diagnosed(case, args.data, folder, previous, since, args.jobs, progress, args.memory))
    (out / "outcomes.json").write_text(json.dumps([o.to_json() for o in outcomes], indent=1))
    right, false = sum(o.rightly for o in outcomes), sum(len(o.false) for o in outcomes)
    return f"{right} of {len(outcomes)} sessions rightly; {false} false names of {SAID} or more"


def main() -> int:
    """Takes this study's own options, and leaves the others to `run_study`."""
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the logs")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--memory", type=Path, metavar="DIR", help="keeps every rollout there, so that a killed study resumes")
    parser.add_argument("--only", nargs="*", default=[], metavar="NAME", help="these sessions alone, beyond the law's")
    parser.add_argument("--splits", nargs="*", default=list(SPLITS), choices=list(SPLITS), help="programmes of the sessions")
    parser.add_argument("--since-only", action="store_true", help="no session from itself alone but the one that gives the law")
    parser.add_argument("--law", type=Path, metavar="MODEL.YAML", help="law of another session that was diagnosed before")
    args, others = parser.parse_known_args()
    return run_study("sts3215", __doc__, partial(study, args), others)


if __name__ == "__main__":
    raise SystemExit(main())
