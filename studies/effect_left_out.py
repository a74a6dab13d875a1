"""Is a wrong explanation ever called one? Each effect that a session holds is taken out of the vocabulary, and the rest asked.

    python -m studies.effect_left_out [SESSION ...] [--out runs/studies/effect_left_out] [--jobs 1]

Diagnoses each session whole, then once more without each effect that was found, and compares what both models leave on stretches
that no fit saw: chi squared in blocks of half a second, by Wilcoxon's signed-rank test, as few blocks hold most of it.
"explained" is wrong where the whole vocabulary leaves less, at one in a thousand. Sessions: data/tutorial_arm unless others are
named. Writes numbers.json after each of them: started again, it diagnoses each session whole again, and without an effect only
where that is not there.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.stats import wilcoxon

from studies.common import ROOT
from workbench.cli.progress import Progress
from workbench.compare.metrics import rms
from workbench.compare.session import Session, load_session
from workbench.files import InputError
from workbench.files.reading import write_whole
from workbench.identify.diagnosis import DiagnosisResult, diagnose_session
from workbench.identify.results.take_report import TakeReport

BLOCK = 0.5
"""Length of the blocks whose sums of squares count as one draw [s]: longer than a servo's memory, a third of a step."""
CERTAIN = 1e-3
"""Chance below which one model tells unseen stretches better than another, and not by accident."""


@dataclass(frozen=True)
class Asked:
    """One session without one effect. named: effect, place, confidence; rms: of unseen residuals over noise, nominal, without,
    with; chance: of the whole vocabulary leaving so much less by accident; seconds: of processor."""

    session: str
    without: str
    verdict: str
    named: tuple[tuple[str, str, float], ...]
    rms: tuple[float, float, float]
    chance: float
    seconds: float

    @property
    def wrongly_explained(self) -> bool:
        """Called explained, though the effect that is missing would tell it better by more than noise."""
        return self.verdict == "explained" and self.chance < CERTAIN

    def line(self) -> str:
        """Of the table."""
        named = "; ".join(f"{e} of {w} ({c:.2f})" for e, w, c in self.named) or "nothing"
        return (f"| {self.session} | {self.without} | {self.verdict}{' (WRONG)' if self.wrongly_explained else ''} | {named} | "
                f"{self.rms[0]:.2f}, {self.rms[1]:.2f}, {self.rms[2]:.2f} | {self.chance:.1g} | {self.seconds:.0f} |")


def unseen_squares(take: TakeReport) -> list[float]:
    """Sums of squared residuals over noise of each block that is at least half unseen."""
    use, block = take.judged, np.floor((take.time - take.time[0]) / BLOCK).astype(int)
    squares = np.nansum(np.square(take.after), axis=1)
    return [float(squares[here & use].sum()) for here in (block == b for b in np.unique(block)) if use[here].mean() > 0.5]


def by_accident(whole: DiagnosisResult, less: DiagnosisResult) -> float:
    """One-sided probability that the smaller vocabulary has so much larger residuals over the blocks if both are equally good."""
    more = np.concatenate([np.subtract(unseen_squares(b), unseen_squares(a)) for a, b in zip(whole.takes, less.takes)])
    return float(wilcoxon(more, alternative="greater").pvalue) if np.any(more) else 1.0


def _rms(result: DiagnosisResult, nominal: bool) -> float:
    return float(rms(np.concatenate([(t.before if nominal else t.after)[t.judged].ravel() for t in result.takes])))


def ask(name: str, session: Session, known: Sequence[Asked], jobs: int, progress: Progress) -> Iterator[Asked]:
    """Each row of a session, those that are known as they are."""
    whole = diagnose_session(session, lambda what, share: progress(f"{name}: {what}", share), jobs)
    for effect in dict.fromkeys(f.effect for f in whole.diagnosis.findings):
        row = next((k for k in known if (k.session, k.without) == (name, effect)), None)
        if row is None:
            began = time.process_time()
            less = diagnose_session(session, lambda what, share, e=effect: progress(  # type: ignore[misc]
                f"{name} without {e}: {what}", share), jobs, without=(effect,))
            row = Asked(name, effect, less.diagnosis.verdict,
                        tuple((f.effect, "/".join(f.where), round(f.confidence, 3)) for f in less.diagnosis.findings),
                        (_rms(whole, True), _rms(less, False), _rms(whole, False)), by_accident(whole, less),
                        time.process_time() - began)
        yield row


def _known(file: Path) -> list[Asked]:
    if not file.exists():
        return []
    return [Asked(**{**row, "named": tuple(tuple(n) for n in row["named"]), "rms": tuple(row["rms"])})
            for row in json.loads(file.read_text())["asked"]]


def main(argv: list[str] | None = None) -> int:
    """0; 1 where something was wrongly explained; 2 for bad input."""
    parser = argparse.ArgumentParser(prog="python -m studies.effect_left_out", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("sessions", nargs="*", type=Path, default=[ROOT / "data/tutorial_arm"], metavar="SESSION")
    parser.add_argument("--out", type=Path, default=ROOT / "runs/studies/effect_left_out", metavar="DIR")
    parser.add_argument("--jobs", type=int, default=1, metavar="N")
    arguments = parser.parse_args(argv)
    file = arguments.out / "numbers.json"
    rows = _known(file)
    try:
        arguments.out.mkdir(parents=True, exist_ok=True)
        with Progress("study effect_left_out") as progress:
            for path in arguments.sessions:
                session = load_session(path)
                name = session.path.parent.name
                for row in ask(name, session, tuple(rows), arguments.jobs, progress):
                    rows = [r for r in rows if (r.session, r.without) != (name, row.without)] + [row]
                    write_whole(file, json.dumps({"asked": [asdict(r) for r in rows]}, indent=1) + "\n")
    except (InputError, OSError) as e:
        print(f"studies.effect_left_out: {e}", file=sys.stderr)
        return 2
    print("| session | without | verdict | named instead | rms over noise: nominal, without, with | by accident | CPU [s] |")
    print("|---|---|---|---|---|---|---|")
    print("\n".join(r.line() for r in rows))
    return int(any(r.wrongly_explained for r in rows))


if __name__ == "__main__":
    sys.exit(main())
