"""Two versions' answers side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from studies.concealed_effects.score import Score


@dataclass(frozen=True)
class Pair:
    """before: of the other version, if there is one."""

    name: str
    before: Score | None
    now: Score


def named(s: Score) -> int:
    """Effects that were named."""
    return sum(e.named for e in s.effects)


def placed(s: Score) -> float:
    """Effects at the right place, with divided credit."""
    return float(sum(e.share or 0.0 for e in s.effects))


def sized(s: Score) -> str:
    """Relative errors of sizes, and a star where the truth is outside the interval."""
    return " ".join(f"{100 * p.error:.0f}%{'' if p.inside else '*'}" for p in s.parameters) or "-"


def sure(s: Score) -> str:
    """Confidences of findings, those that fit nothing in brackets."""
    return " ".join(f"{c:.2f}" if true else f"({c:.2f})" for c, true in s.calibration) or "-"


_COLUMNS: tuple[tuple[str, Callable[[Score], str]], ...] = (
    ("named", lambda s: f"{named(s)}/{len(s.effects)}"), ("placed", lambda s: f"{placed(s):.2f}"), ("size error", sized),
    ("sure", sure),
    ("invented", lambda s: ", ".join(s.false_alarms) or "-"), ("verdict", lambda s: s.verdict),
    ("cpu s", lambda s: f"{s.processor_seconds:.0f}"))


def table(pairs: Sequence[Pair]) -> str:
    """A line a session; where the other version said something else, it stands before an arrow; totals below."""
    lines = [["session", *(name for name, _ in _COLUMNS)], *([p.name, *(_cell(p, of) for _, of in _COLUMNS)] for p in pairs)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    text = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip() for line in lines]
    return "\n".join([*text, *_totals(pairs)])


def _cell(pair: Pair, of: Callable[[Score], str]) -> str:
    now = of(pair.now)
    before = now if pair.before is None else of(pair.before)
    return now if now == before else f"{before} -> {now}"


def _totals(pairs: Sequence[Pair]) -> list[str]:
    out = []
    for title, scores in (("before", [p.before for p in pairs if p.before is not None]), ("now", [p.now for p in pairs])):
        if not scores:
            continue
        seconds = np.array([s.processor_seconds for s in scores])
        sizes = [p for s in scores for p in s.parameters]
        out.append(f"{title}: {sum(map(named, scores))} of {sum(len(s.effects) for s in scores)} named, "
                   f"{sum(map(placed, scores)):.1f} placed, {sum(len(s.false_alarms) for s in scores)} invented, "
                   f"{sum(p.inside for p in sizes)} of {len(sizes)} sizes inside their interval, "
                   f"median {np.median(seconds):.0f} s, most {np.max(seconds):.0f} s of processor")
    return out


def verdict(pairs: Sequence[Pair]) -> int:
    """0, or 1 where an effect was lost or one invented."""
    both = [(p.before, p.now) for p in pairs if p.before is not None]
    lost = sum(map(named, (n for _, n in both))) < sum(map(named, (b for b, _ in both)))
    invented = sum(len(n.false_alarms) for _, n in both) > sum(len(b.false_alarms) for b, _ in both)
    return int(lost or invented)
