"""What `inverse-dynamics` and `compare` do with logs of angles and torques that hold no goals."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from workbench.files.errors import InputError

if TYPE_CHECKING:
    from workbench.robot import RobotModel


def torque_logs(files: Sequence[str | None]) -> bool:
    """Whether the files given are such logs; InputError where only one of two is."""
    from workbench.dynamics.torque_log import is_torque_log

    given = [file for file in files if file is not None]
    found = [file for file in given if is_torque_log(file)]
    if found and len(found) < len(given):
        other = next(file for file in given if file not in found)
        raise InputError(other, f"expected a log of angles and torques, as {found[0]} is; two of them can be compared, or one of "
                                "them with the model alone")
    return bool(found)


def report_torque_logs(verb: str, files: Sequence[str], model: RobotModel, out: Path) -> int:
    """Writes the torque gap of one or two logs, and report.html, into the folder `out`; prints the tables."""
    from workbench.cli.output import output_directory
    from workbench.cli.progress import Progress
    from workbench.dynamics.torque_gap import compare_torques, summary, torque_gap
    from workbench.dynamics.torque_log import read_torque_log
    from workbench.files.reading import write_whole
    from workbench.view.report.torque_gap import torque_report

    stems = [Path(file).stem for file in files]
    names = stems if len(set(stems)) == len(files) else files
    logs = {name: read_torque_log(file, model) for name, file in zip(names, files)}
    with output_directory(out) as folder, Progress(verb, stages=("inverse dynamics", "writing")) as progress:
        progress("inverse dynamics")
        gaps = {name: torque_gap(log, model) for name, log in logs.items()}
        comparison = compare_torques(logs, gaps, model)
        progress("writing")
        summaries = {name: dict(summary(gap)) for name, gap in gaps.items()}
        one = len(summaries) == 1
        content = next(iter(summaries.values())) if one else {"format": 1, "logs": summaries, "compared": comparison}
        write_whole(folder / "torque_gap.json", json.dumps(content, indent=2, allow_nan=False) + "\n")
        torque_report(gaps, comparison, model).write(folder / "report.html")
    for assumed in dict.fromkeys(gap.assumed for gap in gaps.values() if gap.assumed):
        print(f"workbench {verb}: warning: {assumed}", file=sys.stderr)
    for name, gap in gaps.items():
        print(gap.table() if len(gaps) == 1 else f"{name}\n{gap.table()}")
    if comparison:
        print(comparison)
    print(f"wrote {out}: report.html, torque_gap.json")
    return 0
