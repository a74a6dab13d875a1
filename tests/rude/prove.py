"""100,000 faults in one go, part of `make prove`:

    python -m tests.rude.prove [--faults 100000] [--workers 2] [--out runs/rude]

Every fault of every part (host's player, controller's core, host against the core, loader, cameras) in virtual time, in pieces by
seed. OUT keeps finished pieces for each version of the code, so that an interrupted run can be resumed. Exit code 1 where an
invariant was violated.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
JUDGED = ("workbench/device", "workbench/robot", "workbench/motion", "firmware/core", "firmware/tests", "tests/rude",
          "tests/device")
"""Code that the outcome depends on."""
PIECE = 1000
"""Faults in a piece: 15 s of processor at most."""


def play(faults: int, seed: int) -> tuple[int, list[str]]:
    """The host's player on emulated servos."""
    from tests.rude.host_campaign import campaign

    struck, violated = campaign(faults, seed)
    return struck, [f"Run({r.family!r}, {r.fault!r}, {r.k}, {r.seed}): {line}" for r, line in violated]


def controller(faults: int, seed: int) -> tuple[int, list[str]]:
    """The controller's core. The seed is the piece's number: each piece takes other places of the sessions."""
    from tests.rude.test_controller_campaign import campaign

    return faults, campaign(PIECES * faults, seed % PIECES, PIECES)


PIECES = 200


def by_controller(faults: int, seed: int) -> tuple[int, list[str]]:
    """The host's verbs against the controller's core; a session holds one fault and takes as long as ten others."""
    from tests.rude.test_controller_campaign import host_sessions

    with tempfile.TemporaryDirectory() as folder:
        return host_sessions(faults, seed, Path(folder))


def loader(faults: int, seed: int) -> tuple[int, list[str]]:
    """`flash` against the emulated loader."""
    from tests.rude.loader_campaign import campaign

    struck, violated = campaign(faults, seed)
    return struck, [f"{run}: {line}" for run, line in violated]


def cameras(faults: int, seed: int) -> tuple[int, list[str]]:
    """`record` against the emulated server."""
    from tests.rude.capture_campaign import campaign

    struck, violated = campaign(faults, seed)
    return struck, [f"{run}: {line}" for run, line in violated]


PARTS: dict[str, tuple[Callable[[int, int], tuple[int, list[str]]], float]] = {
    "player": (play, 0.45), "controller": (controller, 0.35), "loader": (loader, 0.1), "cameras": (cameras, 0.08),
    "by controller": (by_controller, 0.02)}
"""Each part and its share of the faults."""


def pieces(faults: int) -> Iterator[tuple[str, int, int]]:
    """Part, faults and seed of each piece; the parts in turn, so that a run that is stopped has seen something of each."""
    todo = {name: round(share * faults) for name, (_, share) in PARTS.items()}
    seed = 0
    while any(todo.values()):
        for name, left in todo.items():
            if left:
                yield name, min(left, PIECE), 1000 + seed
                todo[name] = max(left - PIECE, 0)
        seed += 1


def one(name: str, faults: int, seed: int) -> dict:
    """A piece, as it is kept."""
    began = time.process_time()
    struck, violated = PARTS[name][0](faults, seed)
    return {"part": name, "faults": faults, "seed": seed, "struck": struck, "violated": violated,
            "seconds": round(time.process_time() - began, 2)}


def version() -> str:
    """Hash of the code under test and of the campaigns."""
    digest = hashlib.sha256()
    for folder in JUDGED:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".c", ".h"):
                digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--faults", type=int, default=100_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("runs/rude"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    kept = args.out / f"{version()}.jsonl"
    done = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    known = {(d["part"], d["faults"], d["seed"]) for d in done}
    wanted = list(pieces(args.faults))
    done = [d for d in done if (d["part"], d["faults"], d["seed"]) in set(wanted)]
    for d in done:
        _tell(d)
    began = time.monotonic()
    with ProcessPoolExecutor(args.workers, mp_context=get_context("spawn")) as pool, kept.open("a") as file:
        running = {pool.submit(one, *piece) for piece in wanted if piece not in known}
        for future in as_completed(running):
            d = future.result()
            file.write(json.dumps(d) + "\n")
            file.flush()
            done.append(d)
            _tell(d)
            print(f"{len(done)} of {len(wanted)} pieces, {sum(d['struck'] for d in done)} faults, "
                  f"{sum(len(d['violated']) for d in done)} violations, {time.monotonic() - began:.0f} s", file=sys.stderr)
    by_part = Counter(dict.fromkeys(PARTS, 0))
    for d in done:
        by_part[d["part"]] += d["struck"]
    violations = sum(len(d["violated"]) for d in done)
    told = ", ".join(f"{name} {count}" for name, count in by_part.items())
    spent = sum(d["seconds"] for d in done)
    print(f"{sum(by_part.values())} faults ({told}), {violations} violations, {spent:.0f} s of processor")
    return int(violations > 0)


def _tell(d: dict) -> None:
    for line in d["violated"]:
        print(f"{d['part']}, piece of seed {d['seed']}: {line}")


if __name__ == "__main__":
    sys.exit(main())
