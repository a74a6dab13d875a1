"""Diagnoses sessions of known truth by this version of the code and another: python -m studies.replay [--against COMMIT]

The sessions (practice, and some drawn by a fixed seed; no trial's) are made once in OUT. Each version diagnoses each of them
once, into OUT/results/VERSION; a session with a result is not diagnosed again. Rollouts are cached in OUT/rollouts by
everything they depend on, so that a change of the search alone replays in seconds. Prints, paired, names, places, sizes,
confidences, false findings and times; returns 1 where this version names less or has more false findings than the other.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from studies.concealed_effects.ask import Asker, asked
from studies.concealed_effects.score import Score, score_folder, score_nothing
from studies.replay.sessions import COUNT, KnownSession, known_sessions
from studies.replay.table import Pair, table, verdict
from workbench.files import InputError

ROOT = Path(__file__).resolve().parents[2]
LIMIT = 3600.0


def main() -> int:
    """The command line."""
    args = _arguments()
    sessions = known_sessions(args.out / "sessions", args.count)
    if args.sessions:
        unknown = set(args.sessions) - {s.name for s in sessions}
        if unknown:
            print(f"error: no session '{min(unknown)}'; there are {', '.join(s.name for s in sessions)}", file=sys.stderr)
            return 2
        sessions = [s for s in sessions if s.name in args.sessions]
    try:
        other = None if args.against is None else _commit(args.against)
    except subprocess.CalledProcessError:
        print(f"error: --against: '{args.against}' is no commit of this repository", file=sys.stderr)
        return 2
    now = _scores(sessions, ROOT, args.out, f"working-{_digest(ROOT)}", args.workers)
    before: Sequence[Score | None] = [None] * len(sessions)
    if other is not None:
        with _tree(other) as root:
            before = _scores(sessions, root, args.out, other[:16], args.workers)
    pairs = [Pair(s.name, b, n) for s, b, n in zip(sessions, before, now)]
    print(table(pairs))
    return verdict(pairs)


def _scores(sessions: Sequence[KnownSession], root: Path, out: Path, version: str, workers: int) -> list[Score]:
    """Diagnoses of the sessions by a version of the code at `root`."""
    rollouts = out / "rollouts"
    rollouts.mkdir(parents=True, exist_ok=True)
    remembers = "--memory" in (root / "workbench/cli/diagnose.py").read_text(encoding="utf-8")
    asker = Asker(["env", f"PYTHONPATH={root}", sys.executable, "-m", "workbench", "diagnose", "--jobs", "1",
                   *(["--memory", str(rollouts.resolve())] if remembers else [])], limit=LIMIT)

    def ask(s: KnownSession) -> Score:
        results = out / "results" / version / s.name
        asker.ask(s.session, results)
        how = asked(results)
        assert how is not None
        print(f"{version[:16]} {s.name}: {how.seconds:.0f} s" + (f", {how.complaint}" if how.exit else ""), flush=True)
        return replace(_scored(s, results, how.exit, how.complaint), seconds=how.seconds, processor_seconds=how.processor_seconds)

    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(ask, sessions))


def _scored(s: KnownSession, results: Path, code: int, complaint: str) -> Score:
    if code:
        return score_nothing(s.truth, complaint)
    try:
        with tempfile.TemporaryDirectory() as work:
            return score_folder({"truth.json": json.dumps(s.truth).encode()}, results, Path(work))
    except (InputError, ValueError, KeyError, TypeError) as e:
        return score_nothing(s.truth, f"results cannot be read: {type(e).__name__}: {e}")


def _commit(name: str) -> str:
    said = subprocess.run(["git", "-C", str(ROOT), "rev-parse", "--verify", "--quiet", f"{name}^{{commit}}"], check=True,
                          capture_output=True, text=True)
    return said.stdout.strip()


@contextmanager
def _tree(commit: str) -> Iterator[Path]:
    """The commit's files, in a folder that is gone afterwards."""
    with tempfile.TemporaryDirectory() as folder:
        files = subprocess.run(["git", "-C", str(ROOT), "archive", commit], check=True, capture_output=True).stdout
        subprocess.run(["tar", "-x", "-C", folder], input=files, check=True)
        yield Path(folder)


def _digest(root: Path) -> str:
    digest = hashlib.sha256()
    for path in sorted((root / "workbench").rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m studies.replay", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("runs/replay"))
    parser.add_argument("--against", metavar="COMMIT", help="another version, to be paired with")
    parser.add_argument("--count", type=int, default=COUNT, help=f"drawn sessions (default: {COUNT})")
    parser.add_argument("--sessions", nargs="*", metavar="NAME", help="only these")
    parser.add_argument("--workers", type=int, default=1, help="sessions at a time (default: 1)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
