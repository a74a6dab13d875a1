"""What `workbench diagnose` makes of two gains' logs, for each gain left out; minutes each, and what is there is kept.

    python -m studies.xl330.diagnose [--out runs/studies/xl330]

Run it before the study, whose page then judges these models, too, on the gain that they did not see.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from studies.common import run_study
from studies.xl330.__main__ import DATA, GAINS
from studies.xl330.rig import find_logs, published, write_session
from studies.xl330.station import DIAGNOSED
from workbench.compare.session import load_session
from workbench.identify.diagnosis import diagnose_session
from workbench.robot import save_model


def diagnose(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Diagnoses the logs of two gains, for each gain left out (quick: 200 alone), where no model is kept already."""
    logs, m1 = find_logs(DATA), published(DATA, "m1")
    for gain in (200,) if quick else GAINS:
        folder = out / f"without_{gain}"
        if not (folder / DIAGNOSED).is_file():
            progress(f"gain {gain} left out", None)
            session = load_session(write_session(folder, logs, m1, [gain]))
            save_model(diagnose_session(session, progress).diagnosis.model, folder / DIAGNOSED)
    return f"wrote {out}: without_*/{DIAGNOSED}"


if __name__ == "__main__":
    raise SystemExit(run_study("xl330", __doc__, diagnose))
