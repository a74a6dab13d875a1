"""The trial's stages: make and seal, publish the seals, diagnose, open and score, report. Each keeps existing results."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path
from typing import Any

from studies.concealed_effects.ask import Asker, asked
from studies.concealed_effects.carried import scored_before
from studies.concealed_effects.generator import generate
from studies.concealed_effects.page import write_page
from studies.concealed_effects.score import Score, score_folder, score_nothing
from studies.concealed_effects.sealed import Vault
from studies.concealed_effects.summary import summary
from workbench.files import InputError
from workbench.files.reading import read_text, write_whole

Say = Callable[[str], None]


def run(out: Path, vault: Vault, asker: Asker, workers: int = 1, most: int | None = None, say: Say = print) -> dict[str, Any]:
    """The whole trial, or its first `most` sessions; returns the content of summary.json."""
    before = {s.name for s in scored_before(out)}
    generate(out, vault, workers, say, before)
    publish(out, vault, say)
    diagnose(out, [n for n in vault.commitments if n not in before][:most], asker, workers, say)
    return report(out, vault, say)


def publish(out: Path, vault: Vault, say: Say = print) -> None:
    """Records the commitments before anything is diagnosed; ValueError if they changed since."""
    path = out / "seal.json"
    now = {"sha256_of_all": vault.digest(), "seed_drawn_by": vault.drawn_by, "sessions": vault.commitments}
    if len(vault.commitments) != vault.count:
        raise ValueError(f"{vault.folder}: {len(vault.commitments)} of {vault.count} sessions are sealed")
    if path.exists():
        if json.loads(read_text(path)) != now:
            raise ValueError(f"{path}: the seals are not those that were published")
        return
    if (out / "results").exists():
        raise ValueError(f"{out / 'results'}: diagnosed before the seals were published")
    write_whole(path, json.dumps(now, indent=1) + "\n")
    say(f"sealed; SHA-256 of all commitments: {now['sha256_of_all']}")


def diagnose(out: Path, names: list[str], asker: Asker, workers: int = 1, say: Say = print) -> None:
    """`workbench diagnose` on each session without a result; a failure is counted, and the others continue."""
    missing = [n for n in names if asked(out / "results" / n) is None]
    done = len(names) - len(missing)
    pool = ThreadPoolExecutor(workers)
    try:
        asking = {pool.submit(asker.ask, out / "sessions" / n / "session.yaml", out / "results" / n): n for n in missing}
        for each in as_completed(asking):
            how = each.result()
            done += 1
            came = f"{how.seconds:.0f} s" if how.exit == 0 else f"failed: {how.complaint}"
            say(f"diagnosed {asking[each]}: {came} ({done} of {len(names)})")
    except BaseException:
        asker.stop()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def forget_failed(out: Path) -> None:
    """Lets sessions whose diagnosis failed be asked again."""
    for path in (out / "results").glob("*/asked.json"):
        how = asked(path.parent)
        if how is not None and how.exit != 0:
            path.unlink()


def report(out: Path, vault: Vault, say: Say = print) -> dict[str, Any]:
    """Opens the seals of sessions that were diagnosed, and of no others; scores; writes summary.json and report.html."""
    names = [n for n in vault.commitments if asked(out / "results" / n) is not None]
    scores = sorted([*scored_before(out), *(scored(out, vault, name) for name in names)], key=lambda s: s.name)
    result = summary(scores, vault.count) | {"sha256_of_all": vault.digest(), "seed_drawn_by": vault.drawn_by}
    if len(scores) == vault.count:  # the seed opens everything
        result["seed"] = str(vault.seed)
    write_whole(out / "summary.json", json.dumps(result, indent=1) + "\n")
    say(f"wrote {write_page(out / 'report.html', scores, result)}")
    return result


def scored(out: Path, vault: Vault, name: str) -> Score:
    """The score of one session that was diagnosed; results that cannot be read count as a failed diagnosis."""
    answer, results = vault.open(name), out / "results" / name
    truth = json.loads(answer["truth.json"])
    how = asked(results)
    assert how is not None
    if how.exit != 0:
        result = score_nothing(truth, how.complaint)
    else:
        try:
            with tempfile.TemporaryDirectory() as work:
                result = score_folder(answer, results, Path(work))
        except (InputError, ValueError, KeyError, TypeError, AttributeError) as e:
            result = score_nothing(truth, f"results cannot be read: {type(e).__name__}: {e}")
    return replace(result, seconds=how.seconds, processor_seconds=how.processor_seconds, memory=how.memory, code=how.code)
