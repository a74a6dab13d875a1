"""The thesis's own riddles, each as a study: what would a recording show under each explanation, and which measurement decides?

    python -m studies.riddles [--out runs/studies/riddles] [--quick] [--subject NAME ...]

Subjects, each with a page of its own: rounding (why does the recording lag more and more?), speed_order (did the speeds reach the
wrong servos?), loose_screws (do they make the robot drift to the left?), small (last pose, first pose, lean).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from studies.common import run_study
from studies.riddles.hypotheses import Progress
from studies.riddles.loose_screws_page import loose_screws
from studies.riddles.rounding_page import rounding
from studies.riddles.small_page import small
from studies.riddles.speed_order_page import speed_order

SUBJECTS: dict[str, Callable[[Path, bool, Progress], str]] = {
    "rounding": rounding, "speed_order": speed_order, "loose_screws": loose_screws, "small": small}


def riddles(out: Path, quick: bool, progress: Progress, subjects: tuple[str, ...] = tuple(SUBJECTS)) -> str:
    """Runs each subject into a folder of its own."""
    said = []
    for name in subjects:
        def told(what: str, share: float | None, name: str = name) -> None:
            progress(f"{name}: {what}", share)

        said.append(SUBJECTS[name](out / name, quick, told))
    return "\n".join(said)


def main(argv: list[str]) -> int:
    """As every study, and `--subject NAME` for some of it."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--subject", nargs="+", choices=SUBJECTS, default=list(SUBJECTS))
    chosen, rest = parser.parse_known_args(argv)

    def study(out: Path, quick: bool, progress: Progress) -> str:
        return riddles(out, quick, progress, tuple(chosen.subject))

    return run_study("riddles", __doc__, study, rest)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
