"""A trial that takes longer than one machine is available: the repository keeps its beginning, and another machine continues it.

Kept are the scores so far, the seed, and the committed hashes: the rest is made again from the seed and compared with its hash.
Whoever reads the seed here could open the seals, as on one machine; the hash proves that nothing was changed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from studies.concealed_effects.score import Score
from studies.concealed_effects.sealed import Vault, write_plan
from workbench.files.reading import read_text, write_whole

CARRIED = Path(__file__).parent / "results" / "under_way.json"
SCORED = "scored_before.json"
"""In OUT: the scores that came with it."""


def carry(vault: Vault, scores: Sequence[Mapping[str, Any]], path: Path = CARRIED) -> Path | None:
    """Writes what another machine needs, scores as in a trial's summary; of one that is done, nothing."""
    if len(scores) == vault.count:
        path.unlink(missing_ok=True)
        return None
    kept = {"seed": str(vault.seed), "drawn_by": vault.drawn_by, "commitments": vault.commitments,
            "sessions": list(scores)}
    write_whole(path, json.dumps(kept, indent=1) + "\n")
    return path


def take_up(out: Path, path: Path = CARRIED) -> Vault:
    """Starts a folder from the kept part; ValueError if there is none, or if a trial was already started there."""
    if not path.exists():
        raise ValueError(f"{path}: no trial is under way")
    if (out / "sealed").exists():
        raise ValueError(f"{out}: a trial was begun here; take another folder")
    kept = json.loads(read_text(path))
    (out / "sealed").mkdir(parents=True)
    write_plan(out / "sealed", {"seed": int(kept["seed"]), "drawn_by": kept["drawn_by"], "count": len(kept["commitments"])})
    for name, digest in kept["commitments"].items():
        write_whole(out / "sealed" / f"{name}.sha256", digest + "\n")
    write_whole(out / SCORED, json.dumps(kept["sessions"], indent=1) + "\n")
    return Vault(out / "sealed")


def scored_before(out: Path) -> list[Score]:
    """Scores that came from another machine."""
    path = out / SCORED
    entries: list[dict[str, Any]] = json.loads(read_text(path)) if path.exists() else []
    return [Score.from_json(e) for e in entries]
