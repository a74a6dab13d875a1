"""Certifies gaits of data/gaits again by the code as it is, after the robot, the ensemble or the certificate's form has changed.

    python -m studies.gait_recertify speed-0.30 demo --speed 0.10 --effort 1

takes each gait's shape and request from its certificate, and writes motion and certificate where every limit is kept. --speed is
for certificates that do not hold their request.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from studies.gait_rows import GAITS
from workbench.cli.progress import Progress
from workbench.files import InputError
from workbench.gait.certificate import NAME, Certificate, read_certificate, read_shape
from workbench.gait.certify import Certified, certify
from workbench.gait.engines import other_engine
from workbench.gait.ensemble import load_ensemble
from workbench.gait.machine import GaitMachine
from workbench.gait.optimize import OptimizeOptions, options_of, write_gait
from workbench.gait.request import Request
from workbench.gait.table import GaitTable, gait_table
from workbench.robot import puppy_model
from workbench.types import Progress as Callback


def request_of(certificate: Certificate, speed: float | None) -> Request:
    """The request in a certificate; without one, straight ahead at `speed` [m/s]. InputError where neither is known."""
    if certificate.asked:
        return Request.from_plain(certificate.asked)
    if speed is None:
        raise InputError(None, f"{certificate.request}: the certificate holds no request; expected --speed")
    return Request(speed=speed)


def recertified(motion: Path, speed: float | None, options: OptimizeOptions, progress: Callback) -> tuple[GaitTable, Certified]:
    """A gait's table and its new certificate. motion: its gait.csv. speed: see `request_of`."""
    before, machine, ensemble = read_certificate(motion.with_name(NAME)), GaitMachine(puppy_model()), load_ensemble()
    table, request = gait_table(machine, read_shape(motion)), request_of(before, speed)
    said = {**before.provenance, "workbench": version("drake-workbench"), "drake": version("drake"),
            "ensemble": Path(ensemble.source).name, "ensemble_sha256": ensemble.sha256}
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        draws = ensemble.draws(machine.model, options.certify.draws, 2 * options.seed + 1, Path(folder))
        return table, certify(machine, request, table, draws, options.certify, progress, said, other_engine())


def main(argv: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="studies.gait_recertify", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="+", metavar="NAME", help="folder of data/gaits")
    parser.add_argument("--speed", type=float, metavar="V", help="of a gait whose certificate holds no request [m/s]")
    parser.add_argument("--effort", type=int, default=4, metavar="N", help="as for optimize")
    args = parser.parse_args(argv)
    broken = 0
    for name in args.names:
        folder = GAITS / name
        try:
            with Progress(f"recertify {name}") as progress:
                table, done = recertified(folder / "gait.csv", args.speed, options_of(args.effort, n_jobs=1), progress)
        except InputError as e:
            print(f"studies.gait_recertify: error: {e}", file=sys.stderr)
            return 2
        print(done.certificate.summary())
        if done.certificate.kept:
            write_gait(folder, table, done)
        broken += not done.certificate.kept
    return 2 if broken else 0


if __name__ == "__main__":
    raise SystemExit(main())
