"""The trial: python -m studies.concealed_effects.run [--out runs/concealed_effects] [--count 100]

Makes the sessions and seals the truth, publishes the seal's hash, diagnoses every session with the command that a user types, and
only then opens the seal to score. Stopped and started again, it goes on where it was: sessions, diagnoses and scores that are
there are kept.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from studies.concealed_effects.generator import generate
from studies.concealed_effects.score import ParameterScore, Score, score_folder
from studies.concealed_effects.sealed import Vault
from studies.concealed_effects.summary import summary
from workbench.robot.files import read_text, write_whole

Say = Callable[[str], None]
DIAGNOSE = (sys.executable, "-m", "workbench.cli.main", "diagnose")


def run(out: Path, count: int, diagnose: Sequence[str] = DIAGNOSE, say: Say = print) -> dict[str, object]:
    """The whole trial; returns the summary, which is written to summary.json."""
    generate(out, count, say)
    vault = Vault(out / "sealed")
    publish(out, vault, say)
    names = sorted(vault.commitments)
    for name in names:
        diagnose_session(out, name, diagnose, say)
    scores = [scored(out, vault, name) for name in names if (out / "results" / name / "findings.json").exists()]
    result = summary(scores) | {"commitment": vault.digest(), "not_diagnosed": len(names) - len(scores)}
    write_whole(out / "summary.json", json.dumps(result, indent=1) + "\n")
    return result


def publish(out: Path, vault: Vault, say: Say = print) -> None:
    """Writes down what was committed to, before anything is diagnosed; ValueError where it changed since."""
    path = out / "commitment.json"
    now = {"sha256_of_all": vault.digest(), "sessions": vault.commitments}
    if path.exists():
        if json.loads(read_text(path)) != now:
            raise ValueError(f"{path}: the seals are not those that were published")
        return
    if (out / "results").exists():
        raise ValueError(f"{out / 'results'}: diagnosed before the seals were published")
    write_whole(path, json.dumps(now, indent=1) + "\n")
    say(f"sealed; SHA-256 of all commitments: {now['sha256_of_all']}")


def diagnose_session(out: Path, name: str, command: Sequence[str], say: Say = print) -> None:
    """`workbench diagnose` on one session, unless it was; its last line of complaint is kept where it fails."""
    results = out / "results" / name
    if (results / "findings.json").exists():
        return
    results.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    session = out / "sessions" / name / "session.yaml"
    done = subprocess.run([*command, str(session), "--out", str(results)], capture_output=True, text=True, check=False)
    seconds = time.monotonic() - began
    write_whole(results / "diagnose.log", f"exit {done.returncode} after {seconds:.1f} s\n{done.stdout}\n{done.stderr}")
    last = (done.stderr.strip().splitlines() or ["no word"])[-1]
    say(f"{name}: {f'{seconds:.0f} s' if done.returncode == 0 else f'failed ({last})'}")


def scored(out: Path, vault: Vault, name: str) -> Score:
    """The score of one session, kept beside its results."""
    path = out / "results" / name / "score.json"
    if path.exists():
        content = json.loads(read_text(path))
        for key in ("truth", "named", "calibration"):
            content[key] = [tuple(x) for x in content[key]]
        return Score(**content | {"parameters": [ParameterScore(**p) for p in content["parameters"]]})
    with tempfile.TemporaryDirectory() as work:
        result = score_folder(vault.open(name), out / "results" / name, Path(work))
    write_whole(path, json.dumps(result.to_json(), indent=1) + "\n")
    return result


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("runs/concealed_effects"))
    parser.add_argument("--count", type=int, default=100)
    args = parser.parse_args()
    print(json.dumps(run(args.out, args.count), indent=1))


if __name__ == "__main__":
    main()
