"""Tests that are tested: so many small wrong changes of the core, one at a time; how many do the native tests notice?

    python firmware/tests/mutants.py [--count 50] [--seed 1]

Each mutant is compiled in a folder of its own and put under the native tests of tests/firmware. Those that live are shown. A
change that no test of any kind could notice is written down in EQUIVALENT with the reason, and is not drawn.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import shutil
import sys
import tempfile
import time
from multiprocessing import get_context
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(FIRMWARE.parent))

from tests.firmware import native  # noqa: E402

PATIENCE = 150
"""Processor time of a whole run of the tests is about ten seconds [s]."""
CORE = sorted((path.stem.removeprefix("test_") for path in (FIRMWARE.parent / "tests/firmware").glob("test_core_*.py")),
              key=lambda name: (name != "core_edges", name))
FORMATS = ["table_file", "link"]
OF_FORMATS = ("table.c", "frame.c", "crc.c", "upload.c")
"""Parts that the longer tests of the two formats, against Python's reader, reach as well."""
EQUIVALENT = {
    ("motion.c", "return true;", "return false;", "turn_over"):
        "the pose that begins a cycle goes out at the second look of the same wake; nothing comes between but bytes of the links",
}
"""(file, original, replacement, function): why no test can tell."""
CHANGES = (
    (r"(?<![<>=!-])<(?![<=])", "<="), (r"<=", "<"), (r"(?<![->=])>(?![>=])", ">="), (r">=", ">"), (r"==", "!="), (r"!=", "=="),
    (r"&&", "||"), (r"\|\|", "&&"), (r"(?<=[\w)] )\+(?= [\w(])", "-"), (r"(?<=[\w)] )-(?= [\w(])", "+"),
    (r"\breturn true;", "return false;"),
    (r"\breturn false;", "return true;"), (r"\+\+;", "--;"), (r"= false;", "= true;"), (r"= true;", "= false;"),
    (r"\b0u\b", "1u"),
    (r"\b2u\b", "3u"), (r"!(?=[\w(])", ""), (r"\* 1000u", "* 100u"),
)


def candidates() -> list[tuple[Path, int, int, str]]:
    """File, where from, where to, what instead; not in comments, not in includes, and not the sums' tables."""
    found = []
    for path in sorted(FIRMWARE.glob("core/*.c")):
        text = path.read_text()
        heads = [(m.start(), m.group(1)) for m in re.finditer(r"^\w[\w *]*?(\w+)\([^;{]*\) {$", text, re.M)]
        dead = [m.span() for m in re.finditer(r"/\*.*?\*/|^#.*?$|\"[^\"]*\"|'[^']*'|for \([^)]*\)", text, re.S | re.M)]
        for pattern, new in CHANGES:
            for m in re.finditer(pattern, text):
                inside = max((head for head in heads if head[0] <= m.start()), default=(0, ""))[1]
                same = (path.name, m.group(), new, inside) in EQUIVALENT
                if not same and not any(a <= m.start() < b for a, b in dead):
                    found.append((path, *m.span(), new))
    return found


def survives(path: Path, begin: int, end: int, new: str) -> bool:
    """Whether the tests pass although this was changed."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "firmware"
        shutil.copytree(FIRMWARE, folder, ignore=shutil.ignore_patterns("corpus", "build"))
        text = path.read_text()
        (folder / "core" / path.name).write_text(text[:begin] + new + text[end:])
        child = get_context("fork").Process(target=judge, args=(folder, path.name))  # forked: the libraries are loaded once
        child.start()
        child.join(PATIENCE)
        if child.is_alive():
            child.kill()  # it hangs: noticed
            child.join()
        return child.exitcode == 0


def judge(folder: Path, changed: str) -> None:
    """The tests on the core in this folder, in which one file was changed; leaves with pytest's exit code."""
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    os.environ["MOMENTS"] = "12"
    os.chdir(FIRMWARE.parent)
    native.FIRMWARE = folder
    tests = [f"tests/firmware/test_{name}.py" for name in CORE + (FORMATS if changed in OF_FORMATS else ())]
    os._exit(pytest.main(["-q", "-x", "-p", "no:cacheprovider", "-m", "not slow", *tests]))


def main() -> int:
    """Exit code 1 where fewer than 94 % are noticed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    chosen = random.Random(args.seed).sample(candidates(), args.count)
    alive, began = 0, time.monotonic()
    for number, (path, begin, end, new) in enumerate(chosen, 1):
        text = path.read_text()
        line = text.count("\n", 0, begin)
        lives = survives(path, begin, end, new)
        alive += lives
        said = text.splitlines()[line].strip()
        change = f"{text[begin:end]} -> {new or 'nothing'}"
        print(f"{number:3} {'LIVES  ' if lives else 'noticed'} {path.name}:{line + 1}: {change} in: {said}", flush=True)
    print(f"{args.count - alive} of {args.count} mutants noticed in {time.monotonic() - began:.0f} s")
    return int(alive > 0.06 * args.count)


if __name__ == "__main__":
    sys.exit(main())
