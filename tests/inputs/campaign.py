"""Many damaged files, read in a process of its own that is watched: `python -m tests.inputs.campaign --count N --seed S`.

The process says in a shared page which file it reads. Where it dies, takes more than 1 GB beyond its start, or reads longer than
10 s, the case is written down and the next process goes on behind it. Each failure is a line, and the seed makes it again:
`survives(folder, NAME, SEED)`.
"""

from __future__ import annotations

import argparse
import json
import mmap
import multiprocessing
import os
import random
import resource
import shutil
import struct
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.inputs.corpus import beside, corpus
from tests.inputs.test_fuzz import LONGEST, MODELS, NAMES, survives

SHARES = dict.fromkeys(NAMES, 100) | {"motive.csv": 60, "session.yaml": 20} | dict.fromkeys(MODELS, 10)
"""How often each file is drawn: what Drake builds takes a hundred times longer than a table."""
MOST_GROWTH = 1 << 30  # bytes
PAGE = struct.Struct("qqd")  # cases begun, cases done, when the last began


def main() -> None:
    """Runs the cases and prints what was read, refused, and went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    page = mmap.mmap(-1, mmap.PAGESIZE)
    PAGE.pack_into(page, 0, 0, 0, time.monotonic())
    failures, began = 0, time.time()
    done = 0
    while done < args.count:
        worker = multiprocessing.Process(target=_work, args=(page, args.seed, args.count))
        worker.start()
        while worker.is_alive():
            worker.join(1.0)
            begun, done, since = PAGE.unpack_from(page, 0)
            if begun > done and time.monotonic() - since > LONGEST:
                worker.kill()
                worker.join()
        begun, done, _ = PAGE.unpack_from(page, 0)
        if begun > done:  # it died, or was killed, over this one
            failures += 1
            print(f"case {done}, {_case(args.seed, done)}: exit code {worker.exitcode}", flush=True)
            PAGE.pack_into(page, 0, begun, begun, time.monotonic())
            done = begun
    print(f"{args.count} cases from seed {args.seed} in {time.time() - began:.0f} s; {failures} processes ended", flush=True)


def _case(seed: int, index: int) -> tuple[str, int]:
    number = seed * 10_000_000 + index
    name = random.Random(number).choices(list(SHARES), list(SHARES.values()))[0]
    return name, number


def _work(page: mmap.mmap, seed: int, count: int) -> None:
    folder = Path(tempfile.mkdtemp(prefix="campaign", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
    os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
    try:
        beside(folder)
        for name in SHARES:
            (folder / name).write_bytes(corpus(folder)[name])
            survives(folder, name, 1)  # whatever is loaded once
        start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10
        said: Counter[str] = Counter()
        _, first, _ = PAGE.unpack_from(page, 0)
        for index in range(first, count):
            PAGE.pack_into(page, 0, index + 1, index, time.monotonic())
            name, number = _case(seed, index)
            try:
                said[f"{name} {'refused' if survives(folder, name, number) else 'read'}"] += 1
            except AssertionError as e:
                said["failed"] += 1
                print(f"case {index}: {' '.join(str(e).split())[:300]}", flush=True)
            if resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10 > start + MOST_GROWTH:
                said["grew beyond 1 GB"] += 1
                print(f"case {index}, {name}, {number}: memory grew by more than 1 GB", flush=True)
                PAGE.pack_into(page, 0, index + 1, index + 1, time.monotonic())
                break
            if index % 2000 == 0:
                shutil.rmtree(folder / "cache", ignore_errors=True)
            PAGE.pack_into(page, 0, index + 1, index + 1, time.monotonic())
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10) - start
        print(json.dumps(dict(sorted(said.items())) | {"grown MB": grown >> 20}), flush=True)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
