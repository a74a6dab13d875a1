"""The fuzzers: do they find planted faults, how much do they cover, and do they find nothing else?

    python firmware/fuzz/campaign.py plant|clean|cover [--seconds N]

`plant` puts ten faults into copies of the core, one at a time; each has to be found within the time. `clean` runs the targets on
the unchanged core, the time shared among them, and keeps the few inputs that reach the same coverage. `cover` reports the share
of the core's branches that these reach (gcov). Times are processor times, so that a busy machine changes nothing. Kept inputs:
firmware/fuzz/corpus.zip; those that a person wrote: seeds.py.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from seeds import seeds

HERE = Path(__file__).resolve().parent
FIRMWARE = HERE.parent
CORPUS = HERE / "corpus.zip"
SHARES = {"robot": 4, "table": 1, "answer": 1}
"""Parts of the time by target."""
MAX_LENGTH = {"robot": 500, "table": 800, "answer": 300}
COUNTED = ("-use_counters=0", "-print_final_stats=0")
"""For kept inputs: a branch that is taken counts, not how often."""

PLANTED = (
    ("robot", "upload.c", "if (offset > u->got || offset + n > u->size) return UPLOAD_OFFSET;",
     "if (offset > u->got) return UPLOAD_OFFSET;"),
    ("robot", "upload.c", "if (u->running != u->crc || u->crc != CRC32_WITH_ITSELF) return TABLE_CRC;", ""),
    ("robot", "upload.c", "return fault ? fault : table_fits(u->spare, u->active);", "return fault;"),
    ("robot", "upload.c", "if (!fault && u->checked++ < table_poses(u->spare)) return false;",
     "if (!fault && u->checked++ < 1u) return false;"),
    ("robot", "bridge.c", "if (b->got == 4u && (byte < 2u || byte + 4u > BUS_BYTES)) b->got = 0;", ""),
    ("robot", "motion.c", "r->speeds[j] = (uint16_t)(speed > RAMP_SLOWEST ? speed : RAMP_SLOWEST);",
     "r->speeds[j] = (uint16_t)speed;"),
    ("table", "table.c", "if (table_joints(t) == 0 || table_joints(t) > MAX_JOINTS) return TABLE_JOINTS;", ""),
    ("table", "table.c", "p < table_poses(t) && !fault; p++", "p + 1u < table_poses(t) && !fault; p++"),
    ("answer", "frame.c", "if (r->state > LENGTH && r->length > FRAME_PAYLOAD) r->state = FIRST;", ""),
    ("answer", "remote.c", "if (count == 1) return byte == 0x55;", ""),
)
"""target, file, original text, replacement."""


def compile_target(target: str, core: Path, out: Path) -> None:
    """One fuzzer with ASan and UBSan."""
    flags = ["-std=c11", "-O2", "-g", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all"]
    table = f'-DTABLE_FILE="{FIRMWARE / "robotis_walk.table"}"'
    root = core.parent
    sources = [root / f"fuzz/fuzz_{target}.c", *sorted(core.glob("*.c")), root / "tests/sim.c"]
    subprocess.run(["clang", *flags, table, *map(str, sources), "-o", str(out)], check=True)


def fuzz(binary: Path, target: str, seconds: int, corpus: Path, seed: int = 1) -> tuple[bool, float, str]:
    """Whether it crashed, after how much processor time [s], and the last lines."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [str(binary), "-len_control=0", f"-max_len={MAX_LENGTH[target]}", f"-seed={seed}",
               f"-artifact_prefix={corpus.parent}/", "-timeout=300", str(corpus)]
    run = subprocess.run(command, capture_output=True, text=True, check=False,
                         preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5)))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    took = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return run.returncode != -signal.SIGXCPU, took, "\n".join(run.stderr.splitlines()[-12:])


def kept_inputs(target: str, folder: Path) -> list[Path]:
    """The target's kept inputs, and the seeds, as files of this folder."""
    folder.mkdir(parents=True, exist_ok=True)
    contents = list(seeds()) if target == "robot" else []
    if CORPUS.exists():
        with zipfile.ZipFile(CORPUS) as archive:
            contents += [archive.read(name) for name in archive.namelist() if name.startswith(f"{target}/")]
    paths = {folder / hashlib.sha256(content).hexdigest()[:12]: content for content in contents}
    for path, content in paths.items():
        path.write_bytes(content)
    return sorted(paths)


def keep(found: dict[str, list[bytes]]) -> None:
    """One archive of every target's inputs, the same bytes for the same inputs."""
    part = CORPUS.with_suffix(".part")
    with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        for target, contents in sorted(found.items()):
            names = {hashlib.sha256(content).hexdigest()[:12]: content for content in contents}
            for name, content in sorted(names.items()):
                archive.writestr(zipfile.ZipInfo(f"{target}/{name}"), content, zipfile.ZIP_DEFLATED)
    part.replace(CORPUS)


def copy_of(folder: Path) -> Path:
    """Core, fuzz and tests in a folder of their own."""
    for name in ("core", "fuzz", "tests"):
        shutil.copytree(FIRMWARE / name, folder / name, ignore=shutil.ignore_patterns("*.zip", "*.py", "__pycache__"))
    return folder / "core"


def plant(seconds: int) -> int:
    """Each planted fault in turn; returns how many were not found."""
    missed = 0
    for number, (target, name, old, new) in enumerate(PLANTED, 1):
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            core = copy_of(folder)
            text = (core / name).read_text()
            if old not in text:
                raise SystemExit(f"planted fault {number}: {name} no longer holds {old!r}")
            (core / name).write_text(text.replace(old, new))
            compile_target(target, core, folder / "fuzzer")
            kept_inputs(target, folder / "corpus")
            found, took, _ = fuzz(folder / "fuzzer", target, seconds, folder / "corpus")
        missed += not found
        print(f"{number:2} {target:7} {name:12} {'found' if found else 'NOT FOUND'} after {took:.1f} s", flush=True)
    print(f"{len(PLANTED) - missed} of {len(PLANTED)} planted faults found within {seconds} s each")
    return missed


def clean(seconds: int) -> int:
    """Runs on the unchanged core; new inputs of the corpus are kept. Returns how many targets crashed."""
    crashed, kept = 0, {}
    for target, share in SHARES.items():
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            compile_target(target, FIRMWARE / "core", folder / "fuzzer")
            new = folder / "corpus"
            kept_inputs(target, new)
            found, took, said = fuzz(folder / "fuzzer", target, seconds * share // sum(SHARES.values()), new)
            print(f"{target:7} {'CRASHED' if found else 'clean'} in {took:.0f} s", flush=True)
            if found:
                print(said)
                crashed += 1
                continue
            merged = folder / "merged"
            merged.mkdir()
            options = [*COUNTED, f"-max_len={MAX_LENGTH[target]}", "-set_cover_merge=1"]
            subprocess.run([str(folder / "fuzzer"), *options, str(merged), str(new)], capture_output=True, check=True)
            kept[target] = [path.read_bytes() for path in merged.iterdir()]
            print(f"{target:7} keeps {len(kept[target])} of {len(list(new.iterdir()))} inputs", flush=True)
    if not crashed:
        keep(kept)
    return crashed


REPLAY = r"""
#include <stdio.h>
#include <stdint.h>
#include <stddef.h>
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int main(int n, char **paths) {
    static uint8_t bytes[65536];
    for (int k = 1; k < n; k++) {
        FILE *f = fopen(paths[k], "rb");
        if (!f) return 1;
        size_t size = fread(bytes, 1, sizeof bytes, f);
        fclose(f);
        LLVMFuzzerTestOneInput(bytes, size);
    }
    return 0;
}
"""


def cover() -> float:
    """Share of the core's branches that the corpus takes, by gcov."""
    taken: dict[tuple[str, int, int], bool] = {}
    for target in SHARES:
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            core = copy_of(folder)
            (folder / "replay.c").write_text(REPLAY)
            sources = [folder / f"fuzz/fuzz_{target}.c", *sorted(core.glob("*.c")), folder / "tests/sim.c", folder / "replay.c"]
            table = f'-DTABLE_FILE="{FIRMWARE / "robotis_walk.table"}"'
            command = ["gcc", "-std=c11", "-O0", "--coverage", table, *map(str, sources), "-o", "replay"]
            subprocess.run(command, cwd=folder, check=True)
            inputs = [str(path) for path in kept_inputs(target, folder / "corpus")]
            subprocess.run(["./replay", *inputs], cwd=folder, check=True)
            data = sorted(map(str, folder.glob("*.gcda")))
            command = ["gcov", "-b", "--json-format", "--stdout", *data]
            said = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
            for line in said.stdout.splitlines():
                for file in json.loads(line)["files"]:
                    name = Path(file["file"]).name
                    if not (core / name).exists() or name.endswith(".h"):
                        continue
                    for entry in file["lines"]:
                        for k, branch in enumerate(entry["branches"]):
                            place = (name, entry["line_number"], k)
                            taken[place] = taken.get(place, False) or branch["count"] > 0
    share = sum(taken.values()) / len(taken)
    for name in sorted({n for n, _, _ in taken}):
        own = {p: t for p, t in taken.items() if p[0] == name}
        missing = sorted({line for (_, line, _), t in own.items() if not t})
        print(f"{name:14} {sum(own.values()):4} of {len(own):4} branches; not taken in lines {missing}")
    print(f"{100 * share:.1f} % of {len(taken)} branches")
    return share


def main() -> int:
    """Exit code 1 where something is not as it should be."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("plant", "clean", "cover"))
    parser.add_argument("--seconds", type=int, default=60)
    args = parser.parse_args()
    if args.what == "cover":
        return int(cover() < 0.95)
    return int((plant if args.what == "plant" else clean)(args.seconds) > 0)


if __name__ == "__main__":
    sys.exit(main())
