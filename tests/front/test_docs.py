"""README and documentation as they stand: links, code blocks, pages made from code, and the example packages."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from docs.effects_page import LAYERS, LIMITS, PAGE, SEEN, meanings, page
from workbench.cli.main import make_parser
from workbench.effects.registry import known_effects

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
OUTSIDE = ("README.md", "CONTRIBUTING.md", "studies/README.md")
PAGES = [*(ROOT / p for p in OUTSIDE), *sorted(DOCS.glob("*.md"))]
BLOCK = re.compile(r"^```(\w+)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SNIPPET = re.compile(r'^--8<-- "(.+)"$', re.MULTILINE)
LINK = re.compile(r"(?<!\!)\[[^\]]*\]\(([^)\s]+)\)|!\[[^\]]*\]\(([^)\s]+)\)")


def blocks(language: str) -> list[tuple[str, str]]:
    """Page and text of each block, snippets put in."""
    out = []
    for path in PAGES:
        for kind, text in BLOCK.findall(path.read_text(encoding="utf-8")):
            if kind == language:
                out.append((path.name, SNIPPET.sub(lambda m: (ROOT / m.group(1)).read_text(encoding="utf-8"), text)))
    return out


@pytest.mark.parametrize("path", PAGES, ids=lambda p: p.name)
def test_links_lead_somewhere(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    for link in (a or b for a, b in LINK.findall(BLOCK.sub("", text))):
        if link.startswith(("http://", "https://", "mailto:")):
            continue
        file, _, anchor = link.partition("#")
        target = (path.parent / file).resolve() if file else path
        if target == DOCS / PAGE:  # made with the site
            continue
        assert target.exists(), f"{path.name}: {link}"
        if anchor and target.suffix == ".md":
            headings = re.findall(r"^#+ (.+)$", target.read_text(encoding="utf-8"), re.MULTILINE)
            slugs = {re.sub(r"[^\w\- ]", "", h.lower()).strip().replace(" ", "-") for h in headings}
            assert anchor in slugs, f"{path.name}: {link}"


@pytest.mark.parametrize(("name", "code"), blocks("python"), ids=lambda v: v if isinstance(v, str) and len(v) < 30 else "")
def test_python_blocks_run_as_they_stand(name: str, code: str, tmp_path: Path) -> None:
    """Each in an empty folder that contains only the data."""
    (tmp_path / "data").symlink_to(ROOT / "data")
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)},
                          capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, f"{name}:\n{code}\n{done.stderr}"


@pytest.mark.parametrize(("name", "text"), blocks("sh"), ids=lambda v: v if isinstance(v, str) and len(v) < 30 else "")
def test_commands_are_ones_that_the_program_knows(name: str, text: str) -> None:
    """Parsed, not run; their files exist, but for results."""
    for line in filter(None, (part.split("#")[0].strip() for part in text.splitlines())):
        words = shlex.split(line)
        if words[0] == "workbench" and len(words) > 1 and words[1].isupper():
            continue
        if words[0] == "workbench":
            make_parser().parse_args(words[1:])
            for word in words[2:]:
                if word.startswith(("data/", "docs/", "models/")):
                    assert (ROOT / word).exists(), f"{name}: {line}"
        if words[0] == "make":
            assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text(), re.MULTILINE), f"{name}: {line}"


@pytest.mark.parametrize(("name", "text"), blocks("yaml"), ids=lambda v: v if isinstance(v, str) and len(v) < 30 else "")
def test_yaml_blocks_are_yaml(name: str, text: str) -> None:
    assert yaml.safe_load(text) is not None, name


def test_the_page_of_effects_is_made_from_the_code_and_names_all() -> None:
    own = {name for name, e in known_effects().items() if type(e).__module__.startswith("workbench.")}
    assert set(SEEN) == own
    assert re.findall(r"^### (.+)$", page(), re.MULTILINE) == [
        name for layer in LAYERS for name in sorted(own) if known_effects()[name].layer == layer]
    assert set(LIMITS) == {name for name in own if known_effects()[name].reduces_to}
    for seen in SEEN.values():
        assert seen.formula
        for word in re.findall(r"\b[a-z]+_[a-z_]+\b", seen.confused):
            assert word in own, word


def test_the_formats_page_says_what_each_effects_parameters_mean() -> None:
    said = meanings()
    assert said["viscous_friction"] == "`coefficient` N m s/rad, beyond nominal"
    assert set(SEEN) <= set(said)
    for name in SEEN:
        own = {p.name for p in known_effects()[name].parameters}
        assert own == set(re.findall(r"`(\w+)`", said[name])), name


def test_every_page_is_in_the_navigation() -> None:
    nav = yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]

    def files(entry: object) -> list[str]:
        if isinstance(entry, str):
            return [entry]
        parts = entry.values() if isinstance(entry, dict) else entry
        return [f for part in parts for f in files(part)]  # type: ignore[attr-defined]

    assert set(files(nav)) == {p.name for p in DOCS.glob("*.md")} | {PAGE}


def test_the_readme_can_be_read_to_the_end() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) < 200


@pytest.fixture(scope="module")
def examples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example packages, built and installed by pip into a folder of their own."""
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("site")
    packages = ("effect", "format", "servo", "capture")
    for name in packages:
        shutil.copytree(DOCS / "examples" / name, source / name)
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--no-build-isolation",
                    "--target", str(target), *(str(source / name) for name in packages)], check=True)
    return target


def ask(examples: Path, code: str, cwd: Path) -> str:
    environment = os.environ | {"PYTHONPATH": f"{examples}{os.pathsep}{ROOT}"}
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], cwd=cwd, env=environment, capture_output=True, text=True,
                          timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_example_effect_slows_a_joint(examples: Path, tmp_path: Path) -> None:
    code = """
import numpy as np
import workbench
from workbench.motion.commands import Commands
fox = workbench.load_model("fox")
motion = workbench.Motion("step", np.array([0.0, 0.2]), fox.joints, np.array([np.zeros(12), np.full(12, 0.4)]))
reached = []
for model in (fox, fox.with_effect(workbench.EffectSpec("cold_grease", ("LF_KFE",), {"ratio": 30.0}))):
    take = workbench.Simulation(model, workbench.SimulationConfig(base="fixed")).run(motion.commands(), 0.15)
    reached.append(take.q[-1, take.column("LF_KFE")])
print(*reached)
"""
    nominal, greased = map(float, ask(examples, code, tmp_path).split())
    assert greased < 0.7 * nominal


def test_the_example_servo_family_is_known(examples: Path, tmp_path: Path) -> None:
    code = """
from workbench.robot.servo_profile_file import servo_profile
print(servo_profile("DEMO-1").constants().stall_torque)
"""
    assert float(ask(examples, code, tmp_path)) == 2.0


def test_the_example_capture_format_is_read_and_says_what_is_damaged(examples: Path, tmp_path: Path) -> None:
    rows = "".join(f"{k / 100} {k / 1000} 0 0.2 0 0 0 1\n" for k in range(30))
    (tmp_path / "walk.txt").write_text("bodies trunk\n" + rows)
    (tmp_path / "bad.txt").write_text("bodies trunk\n0 1 2\n")
    code = """
from workbench.recording import read_recording
r = read_recording("walk.txt")
print(r.kind, r.sensing, *r.rigid_bodies, *r.rigid_bodies["trunk"].quat[0], r.rigid_bodies["trunk"].p[5, 1], len(r.problems))
try:
    read_recording("bad.txt")
except ValueError as e:
    print(e)
"""
    first, second = ask(examples, code, tmp_path).splitlines()
    assert first.split() == ["room_track", "mocap", "trunk", "1.0", "0.0", "0.0", "-0.0", "0.2", "0"]
    assert "line 2: expected 8 numbers, got 3" in second


def test_the_example_format_is_read_and_says_what_is_damaged(examples: Path, tmp_path: Path) -> None:
    (tmp_path / "log.txt").write_text("ticks of elbow\n" + "".join(f"{10 * k} {2048 + k} {2048 + k // 2}\n" for k in range(20)))
    (tmp_path / "bad.txt").write_text("ticks of elbow\n0 1 2\n10 1\n")
    code = """
from workbench.recording import read_recording
from workbench.files import InputError
r = read_recording("log.txt")
print(r.kind, *r.joints, r.rate, len(r.time))
try:
    read_recording("bad.txt")
except InputError as e:
    print(e)
"""
    said = ask(examples, code, tmp_path).splitlines()
    assert said[0] == "tick_log elbow 100.0 20"
    assert said[1].endswith("bad.txt: line 3: expected three whole numbers, got '10 1'")


def test_the_example_robot_is_simulated(tmp_path: Path, examples: Path) -> None:
    code = f"""
import workbench
arm = workbench.load_model({str(DOCS / 'examples/robot/model.yaml')!r})
station = workbench.MakeStation(arm, workbench.SimulationConfig(base="fixed"))
print(*arm.joints, station.GetInputPort("goal_position").size(), len(arm.foot_links))
"""
    assert ask(examples, code, tmp_path).split() == ["elbow", "shoulder", "2", "0"]
