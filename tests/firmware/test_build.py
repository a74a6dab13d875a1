"""The firmware's build: twice the same bytes, small; registers where ST has them; analysers find nothing."""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.firmware.image import needs_compiler
from tests.firmware.native import FIRMWARE

LIMIT = 16 * 1024
SOURCES = [*sorted(FIRMWARE.glob("core/*.c")), *sorted(FIRMWARE.glob("chip/*.c"))]


def build(folder: Path, source: Path = FIRMWARE) -> tuple[bytes, str]:
    """Image and what `make` printed."""
    made = subprocess.run(["make", "-s", "-C", str(source), f"OUT={folder}"], check=True, capture_output=True, text=True)
    return (folder / "cm530.bin").read_bytes(), made.stdout


@needs_compiler
def test_two_builds_in_two_places_give_the_same_small_image(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    shutil.copytree(FIRMWARE, elsewhere, ignore=shutil.ignore_patterns("build"))
    image, said = build(tmp_path / "one")
    assert build(tmp_path / "two", elsewhere)[0] == image
    assert len(image) < LIMIT
    text, data, bss = (int(x) for x in said.splitlines()[1].split()[:3])
    stack = int(re.search(r"deepest stack: (\d+) bytes", said)[1])
    assert text + data == len(image)
    assert data + bss + stack < LIMIT


@needs_compiler
def test_the_image_is_the_one_that_is_stated(tmp_path: Path) -> None:
    """A change of the program states its new image in firmware/image.txt: what `make firmware` prints."""
    stated = dict(re.findall(r"^([\w -]+): (.+)$", (FIRMWARE / "image.txt").read_text(), re.MULTILINE))
    version = subprocess.run(["arm-none-eabi-gcc", "-dumpversion"], check=True, capture_output=True, text=True).stdout.strip()
    if f"arm-none-eabi-gcc {version}" != stated["compiler"]:
        pytest.skip(f"stated for {stated['compiler']}, here is {version}")
    image, said = build(tmp_path)
    assert len(image) == int(stated["bytes"])
    for name in ("deepest stack", "SHA-256"):
        assert f"{name}: {stated[name]}" in said
    assert hashlib.sha256(image).hexdigest() == stated["SHA-256"]


@needs_compiler
def test_another_table_is_built_in(tmp_path: Path) -> None:
    from tests.firmware.test_core_play import changed

    (tmp_path / "motion.table").write_bytes(changed(7))
    command = ["make", "-s", "-C", str(FIRMWARE), f"OUT={tmp_path}/o", f"TABLE={tmp_path}/motion.table"]
    subprocess.run(command, check=True, capture_output=True)
    assert changed(7) in (tmp_path / "o/cm530.bin").read_bytes()


def svd() -> ET.Element:
    folder = Path(find_spec("pyocd").origin).parent
    with zipfile.ZipFile(folder / "debug/svd/svd_data.zip") as archive:
        name = next(n for n in archive.namelist() if n.endswith("STM32F103xx.svd"))
        return ET.fromstring(archive.read(name))


def number(element: ET.Element, tag: str) -> int:
    return int(element.findtext(tag).strip(), 0)


@pytest.mark.skipif(find_spec("pyocd") is None, reason="needs pyocd's SVD file")
def test_every_register_is_where_st_says() -> None:
    root = svd()
    peripherals = {p.findtext("name"): p for p in root.iter("peripheral")}

    def registers(peripheral: ET.Element) -> dict[str, tuple[int, ET.Element]]:
        own = peripheral if peripheral.find("registers") is not None else peripherals[peripheral.get("derivedFrom")]
        base = number(peripheral, "baseAddress")
        return {r.findtext("name"): (base + number(r, "addressOffset"), r) for r in own.iter("register")}

    known = {f"{p}_{r}": found for p, e in peripherals.items() for r, found in registers(e).items()}
    text = (FIRMWARE / "chip/registers.h").read_text()
    ours = re.findall(r"#define (\w+) REGISTER\((0x[0-9A-F]+)\)", text)
    checked = 0
    for name, address in ours:
        if name.startswith(("SYST_", "NVIC_", "SCB_")):
            continue  # the processor's own are in no SVD of ST's; the board in unicorn has them at ARM's addresses
        assert known[name][0] == int(address, 16), name
        checked += 1
    assert checked > 50
    bits = re.findall(r"(RCC|USART|DMA|ADC|AFIO)_([A-Z0-9]+?)_([A-Z0-9]+) = (\d+) << (\d+)", text)
    fields = 0
    for kind, register, field, value, shift in bits:
        element = next((e for n, (_, e) in known.items() if re.fullmatch(rf"{kind}\d*_{register}\d*", n)), None)
        place = {f.findtext("name"): number(f, "bitOffset") for f in element.iter("field")} if element is not None else {}
        if field in place and value == "1":
            assert place[field] == int(shift), f"{kind}_{register}_{field}"
            fields += 1
    assert fields > 25


def test_no_function_is_too_complex() -> None:
    """Branches of each function, counted from its text: if, for, while, case, &&, ||, ?."""
    worst = {}
    for path in SOURCES:
        for name, body in re.findall(r"^(?:static )?[\w ]+[ *](\w+)\([^;{]*\) \{\n(.*?)^\}", path.read_text(), re.M | re.S):
            worst[f"{path.name}:{name}"] = 1 + len(re.findall(r"\bif\b|\bfor\b|\bwhile\b|\bcase\b|&&|\|\||\?", body))
    assert len(worst) > 100
    assert {k: v for k, v in worst.items() if v > 15} == {}


def test_files_are_short() -> None:
    assert all(len(p.read_text().splitlines()) < 300 for p in FIRMWARE.rglob("*.[ch]"))


@pytest.mark.parametrize(("compiler", "options"), [
    pytest.param("gcc", (), marks=pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")),
    pytest.param("arm-none-eabi-gcc", ("-mcpu=cortex-m3", "-mthumb", "-ffreestanding"), marks=needs_compiler)])
@pytest.mark.slow
def test_the_compilers_analyser_finds_nothing(compiler: str, options: tuple[str, ...]) -> None:
    """In the core by this machine's compiler, in all of it by the one that builds the image."""
    for path in SOURCES if options else sorted(FIRMWARE.glob("core/*.c")):
        flags = ["-std=c11", "-O2", *options, "-Wall", "-Wextra", "-Wconversion", "-Werror", "-fanalyzer", "-c", "-o/dev/null"]
        made = subprocess.run([compiler, *flags, str(path)], capture_output=True, text=True, check=False)
        assert made.returncode == 0, made.stderr


@pytest.mark.skipif(shutil.which("cppcheck") is None, reason="needs cppcheck")
def test_cppcheck_finds_nothing() -> None:
    made = subprocess.run(
        ["cppcheck", "--enable=warning,style,performance,portability", "--error-exitcode=1", "--quiet", "--std=c11",
         "--suppress=missingIncludeSystem", *map(str, SOURCES)], capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
