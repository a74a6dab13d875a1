"""Readability counts that may only shrink; part of `make lint`.

    python .ci/counts.py [--list]

Each count has a limit in LIMITS, which is lowered when it falls; exit code 1 if any is exceeded. --list prints the items counted.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[1]
ROOM = ROOT / "workbench"
LONGEST, MOST_COMPLEX = 300, 15
"""Lines of a file, and complexity of a function, that need no exception."""
STAYS = ("compare", "identify", "experiment")
"""Packages that keep their numbers in option classes, except identify/selection, which the evidence search is to replace."""
NO_NAMES = ("cli", "compare", "experiment", "identify", "view")
"""Packages that know no effect by its name."""
LIMITS = {
    "levels of imports in identify/, selection and options apart": 7,
    "circles of imports": 0,
    "module constants in " + ", ".join(STAYS) + ", outside options": 14,
    "the same in identify/selection": 0,
    "effect names outside effects/": 0,
    f"functions of complexity over {MOST_COMPLEX}": 0,
    f"files of more than {LONGEST} lines": 10,
    "private names that tests import": 0,
}


@cache
def _edges() -> dict[str, set[str]]:
    """The workbench modules that each module imports, not counting imports for annotations."""
    graph = grimp.build_graph("workbench", exclude_type_checking_imports=True)
    return {m: set(graph.find_modules_directly_imported_by(m)) for m in graph.modules}


def levels() -> list[str]:
    """The longest chain of imports within identify/."""
    inside = {m for m in _edges() if m.startswith("workbench.identify.") and ".selection" not in m and not m.endswith(".options")}

    @cache
    def below(module: str) -> tuple[str, ...]:
        chains = [below(m) for m in sorted(_edges()[module] & inside) if m != module]
        return (module, *max(chains, key=len, default=()))

    return list(max((below(m) for m in sorted(inside)), key=len))


def circles() -> list[str]:
    """Modules that import each other, directly or not."""
    reach: dict[str, set[str]] = {}
    for start in _edges():
        seen, todo = set[str](), list(_edges()[start])
        while todo:
            m = todo.pop()
            if m not in seen:
                seen.add(m)
                todo += _edges().get(m, ())
        reach[start] = seen
    return sorted(m for m, seen in reach.items() if m in seen)


def constants(rooms: tuple[str, ...], skipped: str = "") -> list[str]:
    """Numbers at the top of modules."""
    out = []
    for path in (p for room in rooms for p in sorted((ROOM / room).rglob("*.py"))):
        if path.name == "options.py" or (skipped and skipped in path.parts):
            continue
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.Assign) and _is_number(node.value):
                out += [f"{path.relative_to(ROOT)}:{node.lineno} {n.id}" for t in node.targets for n in ast.walk(t)
                        if isinstance(n, ast.Name)]
    return out


def _is_number(node: ast.expr) -> bool:
    """Whether a node is a number, a tuple of numbers, or arithmetic on them."""
    literals = [n.value for n in ast.walk(node) if isinstance(n, ast.Constant)]
    return bool(literals) and all(isinstance(v, int | float) and not isinstance(v, bool) for v in literals)


def effect_names() -> list[str]:
    """Literal names of effects where none should be known; not those that are a servo constant's key as well."""
    keys = set(re.findall(r"^    (\w+):", (ROOM / "robot" / "servo_constants.py").read_text(), flags=re.MULTILINE))
    names = {p.stem for p in (ROOM / "effects" / "library").glob("*.py")} - keys
    out = []
    for path in (p for room in NO_NAMES for p in sorted((ROOM / room).rglob("*.py"))):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and node.value in names:
                out += [f"{path.relative_to(ROOT)}:{node.lineno} {node.value}"]
    return out


def complex_functions() -> list[str]:
    """By ruff, whatever pyproject.toml lets pass."""
    found = subprocess.run([sys.executable, "-m", "ruff", "check", "--isolated", "--select", "C901", "--config",
                            f"lint.mccabe.max-complexity={MOST_COMPLEX}", "--output-format", "json", "workbench", "tests",
                            "studies"], cwd=ROOT, capture_output=True, text=True, check=False)
    return [f"{Path(f['filename']).relative_to(ROOT)}:{f['location']['row']} {f['message']}" for f in json.loads(found.stdout)]


def long_files() -> list[str]:
    """Python files that are hard to overlook."""
    sizes = {p: p.read_text().count("\n") for p in _python_files()}
    return [f"{p.relative_to(ROOT)} {n}" for p, n in sorted(sizes.items()) if n > LONGEST]


def private_imports() -> list[str]:
    """What tests reach into."""
    out = []
    for path in sorted((ROOT / "tests").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and re.match("workbench", node.module or ""):
                out += [f"{path.relative_to(ROOT)}:{node.lineno} {a.name}" for a in node.names if a.name.startswith("_")]
    return out


def _python_files() -> Iterator[Path]:
    for folder in ("workbench", "tests", "studies"):
        yield from (ROOT / folder).rglob("*.py")


COUNTS: dict[str, Callable[[], list[str]]] = dict(zip(LIMITS, (
    levels, circles, lambda: constants(STAYS, "selection"), lambda: constants(("identify/selection",)), effect_names,
    complex_functions, long_files, private_imports), strict=True))


def main(argv: list[str] | None = None) -> int:
    """Counts."""
    parser = argparse.ArgumentParser(prog="python .ci/counts.py", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--list", action="store_true", help="print the items counted")
    listed = parser.parse_args(argv).list
    wrong = False
    for what, count in COUNTS.items():
        found = count()
        limit = LIMITS[what]
        wrong |= len(found) > limit
        said = "" if len(found) == limit else f"; at most {limit}" + (", to be lowered" if len(found) < limit else "")
        print(f"{len(found):4d} {what}{said}")
        if listed or len(found) > limit:
            print("".join(f"       {line}\n" for line in found), end="")
    return int(wrong)


if __name__ == "__main__":
    raise SystemExit(main())
