"""The thesis's five runs (chapter 7.2.2): playback of a recording, and ROBOTIS and recorded angles, each under two filters.

    python -m studies.thesis_runs [--out runs/studies/thesis_runs] [--quick]

As there: six seconds, joints that follow their angles ideally, the thesis's contact (four spheres a foot). The recording is
synthetic, as the thesis's own is not public. Quick: one second at coarse steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from studies import inputs
from studies.common import COORDINATES, publish, run_study, sign
from studies.thesis_runs.figures import draw_runs
from studies.thesis_runs.findings import contact_table, ends_table, findings
from studies.thesis_runs.runs import ANIMATION, SMOOTH, STEPS, Run, five_runs
from workbench.robot import puppy_model
from workbench.view.report.page import Picture, Provenance, Report, Section, Table, Text

_SYNTHETIC = (
    "The recording is **synthetic**: the same puppy in another engine (MuJoCo) with the servo law, filmed as a motion capture "
    "system would (data/synthetic_walk). It stands where the thesis has its capture of the real robot, and is read and "
    "registered in the same way; what it walks is no evidence of what the robot walked.")
_METHOD = " ".join((inputs.__doc__ or "").split("\n\n")[1].split())


def thesis_runs(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Runs the study and writes page, figures and numbers."""
    began = time.monotonic()
    model = puppy_model()
    progress(f"model {model.sha256[:12]}", None)
    seconds, steps = (1.0, (2e-3, 1e-3)) if quick else (inputs.SECONDS, STEPS)
    runs = five_runs(model, seconds, steps, not quick, progress)
    animation, *simulated = (r for r in runs if r.name != SMOOTH)
    figures = {
        "robotis": draw_runs([animation, *simulated[:2]], "ROBOTIS angles (as figure 7.4)"),
        "mocap": draw_runs([animation, *simulated[2:]], "recorded angles (as figure 7.5)"),
        "all": draw_runs([animation, *simulated], "all runs (as figure 7.6)"),
    }
    report = Report(
        "The thesis's five runs", headline(runs), f"{_SYNTHETIC}\n\n{_METHOD}", provenance=Provenance.of(
            model, seconds=time.monotonic() - began, quick="yes: numbers mean nothing" if quick else "no"))
    report.add(Section("Where the body ends", [ends_table(runs)]))
    report.add(Section("Over time", [
        Picture(figures["all"], "Bands: the same run with the step halved and quartered. Triangles: the thesis's ends."),
        Picture(figures["robotis"]), Picture(figures["mocap"])]))
    says = Table(("the thesis", "here"), list(findings(runs)))
    report.add(Section("Beside what the thesis says", [says, *([contact_table(runs)] if not quick else [])]))
    report.add(Section("What is not the same", [Text(
        "The robot starts settled in neutral and takes 0.3 s to its first angles; the thesis drops it from slightly above the "
        "floor. The thesis hands angles and separately filtered derivatives to its solver; here the angles are filtered, and "
        "derivatives follow. Friction is 0.5 throughout, its kinetic value, as discrete plants know one coefficient.")]))
    return publish(out, model, report, numbers(runs), figures)


def headline(runs: list[Run]) -> str:
    """The result in one sentence."""
    by = {r.name: r for r in runs}

    def of(a: str, b: str) -> str:
        return " and ".join(f"{sign(by[n].end('x'), 0)} cm (turned by {sign(by[n].end('ry'), 0)}°)" for n in (a, b))

    return (f"Ideal joints with ROBOTIS angles end at {of('robotis M', 'robotis')}, with recorded angles at "
            f"{of('mocap M', 'mocap')}; the (synthetic) recording goes {by[ANIMATION].end('x'):.0f} cm. The thesis: 32 to 33, "
            "and 37.")


def numbers(runs: list[Run]) -> dict[str, object]:
    """Each end with its floor and the other contact model's shift."""
    return {"runs": {
        r.name: {c: {"end": r.end(c), "floor": r.floor(c) if r.name != ANIMATION else None,
                     "other_contact": r.contact_spread(c) if r.other_contact is not None else None} for c in COORDINATES}
        for r in runs}}


if __name__ == "__main__":
    raise SystemExit(run_study("thesis_runs", __doc__, thesis_runs))
