"""The trial of diagnosis: python -m studies.concealed_effects [--out runs/concealed_effects] [--count 100] [--workers 1]

Another engine's robots with hidden physics: makes the sessions and seals the truth (the seed is drawn by the operating system
once, at the first run), writes down the seal's hash, diagnoses every session with the `workbench diagnose` that a user types, and
only then opens the seal of each to score it. OUT gets seal.json, sessions/, results/, sealed/, summary.json and report.html.
If it is interrupted and started again, it continues; a diagnosis that fails or takes too long counts as failed. If not all
sessions are diagnosed, the report states that.

Returns 0 if every target is met, else 1.
"""

from __future__ import annotations

import argparse
import signal
import sys
from pathlib import Path

from studies.concealed_effects.ask import LIMIT, Asker
from studies.concealed_effects.carried import carry, take_up
from studies.concealed_effects.generator import is_what_was_sealed
from studies.concealed_effects.published import PAGE, RESULTS, keep
from studies.concealed_effects.sealed import COUNT, Vault
from studies.concealed_effects.trial import forget_failed, report, run


def main() -> int:
    """The command line."""
    args = _arguments()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    try:
        if (args.report or args.keep or args.verify or args.again) and not (args.out / "sealed").exists():
            raise ValueError(f"{args.out}: no trial was begun here")
        vault = take_up(args.out) if args.take_up else Vault(args.out / "sealed", args.count, args.seed)
        if args.verify:
            same = is_what_was_sealed(vault, args.verify)
            print(f"{args.verify}: the session from this seed is {'' if same else 'not '}the sealed one")
            return 0 if same else 1
        if args.again:
            forget_failed(args.out)
        result = report(args.out, vault) if args.report or args.keep else run(
            args.out, vault, Asker(limit=args.limit), args.workers, args.sessions, _say)
    except ValueError as e:
        print(f"error: {e}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("stopped; run again to continue", file=sys.stderr)
        return 130
    for c in result["criteria"]:
        print(f"{c['what']}: {c['got']} (asked: {c['asked']})")
    print(f"{result['diagnosed']} of {result['planned']} sessions, {result['failed']} failed")
    if args.keep:
        under_way = carry(vault, result["sessions"])
        if under_way is None:
            keep(result)
        print(f"wrote {under_way} for another machine" if under_way else f"wrote {RESULTS} and the table in {PAGE}")
    return 0 if result["met"] else 1


def _say(line: str) -> None:
    print(line, flush=True)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m studies.concealed_effects", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("runs/concealed_effects"))
    parser.add_argument("--count", type=int, help=f"sessions to make, said once (default: {COUNT})")
    parser.add_argument("--workers", type=int, default=1, help="sessions at a time (default: 1)")
    parser.add_argument("--sessions", type=int, metavar="N", help="diagnose only the first N now: a partial trial")
    parser.add_argument("--limit", type=float, default=LIMIT, metavar="S", help=f"seconds for a diagnosis (default: {LIMIT:g})")
    parser.add_argument("--again", action="store_true", help="ask again what failed before")
    parser.add_argument("--report", action="store_true", help="only score the diagnosed sessions, and write the report")
    parser.add_argument("--keep", action="store_true",
                        help="the same, and put the summary into the repository; of a partial trial, the data to continue it")
    parser.add_argument("--take-up", action="store_true", help="in a new OUT, continue the partial trial in the repository")
    parser.add_argument("--verify", metavar="NAME", help="make a session again and compare it with its seal")
    parser.add_argument("--seed", type=int, help="for development only; a report says that it was chosen by hand")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
