"""Checks this machine for the workbench, and suggests how to install missing parts."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from collections.abc import Callable, Collection
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Literal

import workbench
from workbench.files import InputError
from workbench.files.plug_ins import list_installed

State = Literal["ok", "missing", "broken"]
MEMORY_GB, DISK_GB = 4.0, 1.0
"""With less memory a diagnosis on two processes swaps; with less disk the results of a few takes do not fit."""
PYTHON = (3, 11)


@dataclass(frozen=True)
class Check:
    """One check. state: "missing" is optional or can be installed; "broken" prevents the workbench from working. remedy: what to
    do; empty if nothing has to be done."""

    name: str
    state: State
    found: str
    remedy: str = ""


@dataclass(frozen=True)
class Health:
    """The results of all checks."""

    checks: tuple[Check, ...]

    @property
    def works(self) -> bool:
        """Whether nothing is broken."""
        return all(c.state != "broken" for c in self.checks)

    def as_dict(self) -> dict[str, Any]:
        """Plain types, for JSON."""
        return {"works": self.works, "checks": [asdict(c) for c in self.checks]}

    def as_text(self) -> str:
        """A line for each check, its remedy under it."""
        width = max(len(c.name) for c in self.checks)
        lines = []
        for c in self.checks:
            lines.append(f"{c.state:>7}  {c.name:<{width}}  {c.found}")
            if c.remedy:
                lines.append(f"{'':>7}  {'':<{width}}  -> {c.remedy}")
        return "\n".join(lines)


def compile_rollouts() -> None:
    """Compiles the station, where numba is installed and this has not been done; a warning says that it takes a minute."""
    try:
        from workbench.simulation.compiled import compile_lanes, compile_station
    except ImportError:
        return  # `examine` reports it
    compile_station()
    compile_lanes()


def examine(defaults: Path) -> Health:
    """Checks versions, cores, memory, disk, the compiler's cache, Meshcat, the second engine and shell completion. defaults: path
    of the user's own defaults."""
    looks: tuple[Callable[[], Check], ...] = (
        _python, lambda: _package("drake", "pydrake.all", True, "pip install drake; on Debian it needs libglib2.0-0"),
        lambda: _package("numpy", "numpy", True, "pip install numpy"),
        lambda: _package("scipy", "scipy", True, "pip install scipy"),
        lambda: _package("numba", "numba", False, "pip install numba: compiled rollouts, which fits use"),
        lambda: _package("mujoco", "mujoco", False, "pip install 'mujoco[sysid]': the second engine of studies and certificates"),
        _cores, _memory, _disk, _check_compiled, _meshcat, _completion, _effects, _formats, _servos, lambda: _defaults(defaults))
    return Health((Check("workbench", "ok", f"{workbench.__version__} in {Path(workbench.__file__).parent}"),
                   *(look() for look in looks)))


def _python() -> Check:
    found = f"{platform.python_version()} ({sys.executable}), {platform.platform()}"
    old = sys.version_info < PYTHON
    return Check("Python", "broken" if old else "ok", found, f"install Python {PYTHON[0]}.{PYTHON[1]} or newer" if old else "")


def _package(name: str, module: str, needed: bool, remedy: str) -> Check:
    try:
        found = version(name)
    except PackageNotFoundError:
        return Check(name, "broken" if needed else "missing", "not installed", remedy)
    try:
        import_module(module)
    except Exception as e:  # any exception on import is the finding
        return Check(name, "broken", f"{found} does not load: {' '.join(str(e).split())[:120]}", remedy)
    return Check(name, "ok", found)


def _cores() -> Check:
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Check("cores", "ok", f"{usable} (use them with --jobs {usable})")


def _memory() -> Check:
    try:
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    except (ValueError, OSError, AttributeError):
        return Check("memory", "ok", "not known on this system")
    few = total < MEMORY_GB
    return Check("memory", "missing" if few else "ok", f"{total:.1f} GB",
                 f"below {MEMORY_GB:g} GB use --jobs 1" if few else "")


def _disk() -> Check:
    free = shutil.disk_usage(Path.cwd()).free / 2**30
    few = free < DISK_GB
    return Check("disk here", "missing" if few else "ok", f"{free:.1f} GB free",
                 f"results may not fit: free {DISK_GB:g} GB, or give --out on another disk" if few else "")


def _check_compiled() -> Check:
    try:
        from workbench.simulation.compiled.kernel import cache_folder
    except ImportError:
        return Check("compiled rollouts", "missing", "numba is not installed")
    folder = cache_folder()
    if folder.is_dir() and any(folder.iterdir()):
        size = sum(p.stat().st_size for p in folder.rglob("*") if p.is_file()) / 2**20
        return Check("compiled rollouts", "ok", f"{size:.0f} MB in {folder}")
    at = folder
    while not at.exists():
        at = at.parent
    if not os.access(at, os.W_OK):
        return Check("compiled rollouts", "missing", f"{at} cannot be written", "set NUMBA_CACHE_DIR, or each run compiles again")
    return Check("compiled rollouts", "ok", f"not compiled yet; the first rollout takes a minute longer (in {folder})",
                 "workbench doctor --compile")


def _meshcat() -> Check:
    try:
        from workbench.view.scene.live import open_meshcat

        url = open_meshcat().web_url()
    except Exception as e:  # Drake raises various types here
        return Check("Meshcat", "missing", " ".join(str(e).split())[:120], "free a port from 7000 on, or use --port")
    return Check("Meshcat", "ok", f"serves at {url}")


def _effects() -> Check:
    from workbench.effects.registry import ENTRY_POINT_GROUP, known_effects

    return _extensible("effects", ENTRY_POINT_GROUP, known_effects)


def _formats() -> Check:
    from workbench.recording.formats.registry import ENTRY_POINT_GROUP, known_formats

    return _extensible("recording formats", ENTRY_POINT_GROUP, lambda: [f.name for f in known_formats()])


def _servos() -> Check:
    from workbench.robot.servo_profile_file import ENTRY_POINT_GROUP, servo_profiles

    return _extensible("servo families", ENTRY_POINT_GROUP, servo_profiles)


def _extensible(name: str, group: str, known: Callable[[], Collection[str]]) -> Check:
    """Everything known of one kind, by name, and the packages that add to it."""
    added = [f"{entry} from package {package}" for entry, package in list_installed(group).items()]
    try:
        names = sorted(known())
    except InputError as e:
        return Check(name, "broken", str(e), "repair that package, or uninstall it")
    return Check(name, "ok", f"{len(names)}: {', '.join(names)}; plug-ins: {', '.join(added) or 'none'}")


def _completion() -> Check:
    remedy = 'eval "$(register-python-argcomplete workbench)" in ~/.bashrc or ~/.zshrc'
    return Check("shell completion", "ok", f"to have it: {remedy}")


def _defaults(path: Path) -> Check:
    return Check("your defaults", "ok", str(path) if path.is_file() else f"none ({path})")
