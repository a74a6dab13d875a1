"""Searches for a gait with several seeds, and keeps the one of median speed in data/gaits.

    python -m studies.gait_row_seeds NAME --seeds 0 1 2 -- --speed 0.30

runs `workbench optimize` once for each seed, each in a folder of its own below --out, and leaves out the seeds whose folder holds
a certificate already. data/gaits/NAME then holds the motion and the certificate of the median seed, the command, and seeds.csv.
"""

from __future__ import annotations

import argparse
import csv
import io
import resource
import shlex
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from studies.gait_rows import COMMAND, GAITS, SEEDS
from workbench.files import InputError
from workbench.files.reading import read_text, write_together, write_whole
from workbench.gait.certificate import NAME, Certificate, read_certificate

SPENT = "processor_seconds.txt"
"""Of each seed's folder."""


@dataclass(frozen=True)
class Seed:
    """What came of one seed. certificate: None where nothing was found; seconds: of processor."""

    seed: int
    folder: Path
    certificate: Certificate | None
    seconds: float

    @property
    def kept(self) -> bool:
        """Whether it was certified."""
        return self.certificate is not None and self.certificate.kept


def searched(folder: Path, seed: int, arguments: Sequence[str]) -> Seed:
    """One seed, searched for unless that was done before."""
    if not (folder / NAME).is_file() and not (folder / SPENT).is_file():
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, "-m", "workbench", "optimize", *arguments, "--seed", str(seed), "--out", str(folder)]
        subprocess.run(command, check=False)  # a refusal is a result
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / SPENT, f"{after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime:.0f}\n")
    spent = float(read_text(folder / SPENT)) if (folder / SPENT).is_file() else float("nan")
    certificate = read_certificate(folder / NAME) if (folder / NAME).is_file() else None
    return Seed(seed, folder, certificate, spent)


def median(seeds: Sequence[Seed]) -> Seed:
    """The seed of median speed on the nominal robot among those that were certified, of two the slower. InputError where none
    was."""
    kept = sorted((s for s in seeds if s.kept), key=lambda s: s.certificate.nominal.speed if s.certificate else 0.0)
    if not kept:
        raise InputError(None, f"none of {len(seeds)} seeds was certified")
    return kept[(len(kept) - 1) // 2]


def as_csv(seeds: Sequence[Seed]) -> str:
    """seeds.csv: a row for each."""
    text = io.StringIO()
    write = csv.writer(text, lineterminator="\n").writerow
    write(["seed", "certified", "speed", "unit", "5th percentile", "heading deg/m RMS", "rollouts", "processor s"])
    for s in seeds:
        c = s.certificate
        if c is None:
            write([s.seed, "no", "", "", "", "", "", f"{s.seconds:.0f}"])
            continue
        five = c.draws.get(f"speed {c.nominal.unit}", [None, None])[1]
        write([s.seed, "yes" if c.kept else "no", f"{c.nominal.speed:.3f}", c.nominal.unit, "" if five is None else f"{five:.3f}",
               f"{c.draws.get('heading deg/m RMS', float('nan')):.1f}", c.provenance.get("rollouts", ""), f"{s.seconds:.0f}"])
    return text.getvalue()


def keep(name: str, seeds: Sequence[Seed], arguments: Sequence[str], gaits: Path = GAITS) -> Path:
    """Writes data/gaits/NAME, all or nothing."""
    best = median(seeds)
    command = f"workbench optimize {shlex.join(arguments)} --seed {best.seed}"
    folder = gaits / name
    folder.mkdir(parents=True, exist_ok=True)
    write_together(folder, {"gait.csv": read_text(best.folder / "gait.csv"), NAME: read_text(best.folder / NAME),
                            COMMAND: command + "\n", SEEDS: as_csv(seeds)})
    return folder


def main(argv: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    given = list(sys.argv[1:] if argv is None else argv)
    split = given.index("--") if "--" in given else len(given)
    parser = argparse.ArgumentParser(prog="studies.gait_row_seeds", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", help="folder below data/gaits")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3, 4])
    parser.add_argument("--out", type=Path, default=Path("runs/gait_rows"))
    args, arguments = parser.parse_args(given[:split]), given[split + 1:]
    seeds = [searched(args.out / args.name / f"seed-{k}", k, arguments) for k in args.seeds]
    print(as_csv(seeds), end="")
    try:
        print(f"wrote {keep(args.name, seeds, arguments)}")
    except InputError as e:
        print(f"studies.gait_row_seeds: error: {e}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
