"""Whether two runs of `workbench diagnose` say the same: findings.json and model.yaml, hashed without version, time and settings.

    python -m studies.same_findings BEFORE AFTER

BEFORE, AFTER: folders with one folder for each session, as `--out` named it. Prints both hashes of each session that is in both,
and what differs; 0 where nothing does, 1 where something does or the two have no session in common.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from pathlib import Path
from typing import Any

import yaml

FILES = ("findings.json", "model.yaml")
OF_THE_RUN = {"workbench", "drake", "seconds", "config"}
"""Keys of `provenance` that no result depends on."""


def without_run(content: dict[str, Any]) -> dict[str, Any]:
    """A result without what only says when, and by which version, it was made."""
    kept = {k: v for k, v in content.get("provenance", {}).items() if k not in OF_THE_RUN}
    return content | {"provenance": kept}


def result_of(folder: Path) -> dict[str, Any]:
    """The results of one diagnosis, by file."""
    findings, model = (folder / name for name in FILES)
    return {FILES[0]: without_run(json.loads(findings.read_text())), FILES[1]: without_run(yaml.safe_load(model.read_text()))}


def sha256_of(result: dict[str, Any]) -> str:
    """Of the content, whatever the order of keys and the form of numbers in the file."""
    return hashlib.sha256(json.dumps(result, sort_keys=True, default=str).encode()).hexdigest()


def differences(before: Any, after: Any, at: str = "") -> list[str]:
    """Where two results differ, by the keys that lead there."""
    if isinstance(before, dict) and isinstance(after, dict):
        return [line for key in sorted({*before, *after})
                for line in differences(before.get(key), after.get(key), f"{at}/{key}")]
    if isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        return [line for i, (a, b) in enumerate(zip(before, after)) for line in differences(a, b, f"{at}/{i}")]
    return [] if before == after else [f"{at}: {before} -> {after}"]


def main(argv: list[str] | None = None) -> int:
    """The verb."""
    parser = argparse.ArgumentParser(prog="python -m studies.same_findings", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    a = parser.parse_args(argv)
    names = sorted(p.parent.name for p in a.before.glob(f"*/{FILES[0]}") if (a.after / p.parent.name / FILES[0]).is_file())
    same = bool(names)
    for name in names:
        before, after = result_of(a.before / name), result_of(a.after / name)
        found = differences(before, after)
        same &= not found
        print(f"{name}: {sha256_of(before)[:16]} {sha256_of(after)[:16]} {'same' if not found else 'DIFFERENT'}")
        print("".join(f"  {line}\n" for line in found), end="")
    if not names:
        print(f"no session has a {FILES[0]} in both {a.before} and {a.after}")
    return 0 if same else 1


if __name__ == "__main__":
    raise SystemExit(main())
