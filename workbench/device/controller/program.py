"""From a motion to the image that is loaded: table, checks, compiler."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from workbench.device.controller.loader_profile import LoaderProfile, check_image
from workbench.device.tables.limits import Violation, refuse_broken_limits
from workbench.device.tables.table_file import TableFile, encode_table, read_table_file, table_file, too_long
from workbench.files import InputError
from workbench.files.resources import resource_dir
from workbench.motion import load_motion
from workbench.robot import RobotModel
from workbench.robot.servo_units import known_units

COMPILER = "arm-none-eabi-gcc"


@dataclass(frozen=True)
class Program:
    """A program to load: the image, the table in it, and the results of `check_limits`."""

    image: bytes
    table: TableFile
    violations: tuple[Violation, ...]

    @property
    def sha256(self) -> str:
        """Digest of the image: the same program, built by the same compiler, has the same."""
        return hashlib.sha256(self.image).hexdigest()


CYCLES = 10
"""After which a robot stops that nobody has told for how long: the radio that would stop it loses words."""


def table_of(motion: str | Path, model: RobotModel, cycles: int | None, force: bool,
             endless: bool = False) -> tuple[TableFile, tuple[Violation, ...]]:
    """The table of a motion (CSV or .mtn), or a binary table unchanged; InputError where a limit is broken, unless `force`.

    cycles: stops after so many; None: as many as in the motion, else CYCLES. endless: repeats until it is stopped.
    """
    if Path(motion).suffix == ".table":
        return read_table_file(motion), ()
    loaded = load_motion(motion, model)
    known_units(model, loaded.joints)
    table = loaded.as_table()
    violations = refuse_broken_limits(table, model, force, None, "not loaded")
    often = 0 if endless else loaded.often(cycles, CYCLES)
    return table_file(table, model, often, not endless), tuple(violations)


def build_program(motion: str | Path, model: RobotModel, profile: LoaderProfile, folder: Path, cycles: int | None = None,
                  force: bool = False, endless: bool = False) -> Program:
    """Conversion, compilation and a check of the result; all in `folder`. InputError names the obstacle."""
    table, violations = table_of(motion, model, cycles, force, endless)
    data = encode_table(table)
    long = too_long(len(table.joints), len(table.table))
    if long:
        raise InputError(motion, long)
    if shutil.which(COMPILER) is None or shutil.which("make") is None:
        raise InputError(COMPILER, "not found; Debian: apt-get install --no-install-recommends gcc-arm-none-eabi make")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder.resolve() / "motion.table"
    path.write_bytes(data)
    command = ["make", "-s", "-C", str(resource_dir("firmware")), f"OUT={folder.resolve()}", f"TABLE={path}"]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    if made.returncode:
        last = (made.stderr.strip() or made.stdout.strip()).splitlines()[-1:]
        raise InputError(resource_dir("firmware"), f"does not compile: {''.join(last)}")
    image = (folder / "cm530.bin").read_bytes()
    check_image(image, profile, str(folder / "cm530.bin"))
    if data not in image:
        raise InputError(folder / "cm530.bin", "does not hold the table that was to be built in")
    return Program(image, table, violations)
