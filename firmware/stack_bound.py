"""The deepest stack of the firmware, from the compiler's own call graphs (gcc -fcallgraph-info=su): `stack_bound.py BUILD`."""

from __future__ import annotations

import re
import sys
from pathlib import Path

FRAME = 32
"""Bytes that the processor itself pushes for an interrupt."""
INTERRUPTS = ("systick_interrupt", "bus_interrupt", "bus_received_interrupt", "pc_interrupt", "zigbee_interrupt")
LIBRARY = {"__aeabi_uldivmod": 48, "__aeabi_ldivmod": 48, "memcpy": 16, "memset": 16, "memmove": 16}
"""Bounds of what libgcc brings [bytes]."""


def read(build: Path) -> tuple[dict[str, int], dict[str, set[str]]]:
    """Bytes of each function's own frame, and whom it calls."""
    own: dict[str, int] = {}
    calls: dict[str, set[str]] = {}
    for path in sorted(build.rglob("*.ci")):
        text = path.read_text()
        for title, label in re.findall(r'node: \{ title: "([^"]+)" label: "([^"]*)"', text):
            size = re.search(r"(\d+) bytes \((static|dynamic[^)]*)\)", label)
            if size:
                if size[2] != "static":
                    raise SystemExit(f"{title}: its frame is {size[2]}; no bound can be given")
                own[title] = int(size[1])
        for source, target in re.findall(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', text):
            calls.setdefault(source, set()).add(target)
    return own, calls


def deepest(function: str, own: dict[str, int], calls: dict[str, set[str]], above: tuple[str, ...] = ()) -> int:
    """Bytes from this function down; a circle, or a call through a pointer, has no bound."""
    if function in above:
        raise SystemExit(f"recursion: {' > '.join((*above, function))}")
    if function == "__indirect_call":
        raise SystemExit(f"{above[-1]} calls through a pointer; no bound can be given")
    below = (deepest(f, own, calls, (*above, function)) for f in calls.get(function, ()))
    size = own.get(function, LIBRARY.get(function.rsplit(":", 1)[-1]))
    if size is None:
        raise SystemExit(f"{function}: frame unknown")
    return size + max(below, default=0)


def bound(build: Path) -> int:
    """Main program, then one interrupt on top of it (they do not nest) [bytes]."""
    own, calls = read(build)
    named = {f.rsplit(":", 1)[-1]: f for f in own}
    interrupt = max(deepest(named[i], own, calls) for i in INTERRUPTS)
    return deepest(named["run"], own, calls) + own[named["begin"]] + FRAME + interrupt


if __name__ == "__main__":
    print(f"deepest stack: {bound(Path(sys.argv[1]))} bytes")
