"""The wheel works away from the source tree: models and data inside, typed, usable from another Drake project."""

import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source distribution; the wheel, built from it as a release is, lies beside it."""
    tree, out = tmp_path_factory.mktemp("tree") / "project", tmp_path_factory.mktemp("dist")
    tracked = _run(["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"], ROOT).stdout.split("\0")
    for name in filter(None, tracked):  # a copy, so that building leaves nothing in the source tree
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tree / name)
    _run([sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), "."], tree)
    (built,) = out.glob("*.tar.gz")
    return built


@pytest.fixture(scope="module")
def wheel(sources: Path) -> Path:
    (built,) = sources.parent.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Python of a fresh environment with the wheel installed. What the wheel depends on is lent by this environment,
    in which the project itself, installed editable, must not be found."""
    environment = tmp_path_factory.mktemp("environment")
    _run([sys.executable, "-m", "venv", str(environment)])
    python = environment / "bin" / "python"
    _run([str(python), "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", str(wheel)])
    site = Path(_run([str(python), "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]).stdout.strip())
    lent = dict.fromkeys([sysconfig.get_path("purelib"), sysconfig.get_path("platlib")])
    (site / "lent.pth").write_text("".join(f"{path}\n" for path in lent))  # the .pth files in there are not read
    return python


def test_models_and_data_are_inside(wheel: Path) -> None:
    inside = set(zipfile.ZipFile(wheel).namelist())
    assert "workbench/py.typed" in inside
    for kind, folder in (("models", "models/sdf"), ("data", "data")):
        wanted = [p.relative_to(ROOT / folder).as_posix() for p in (ROOT / folder).rglob("*") if p.is_file()]
        assert wanted
        assert not {f"workbench/resources/{kind}/{name}" for name in wanted} - inside
    assert "workbench/resources/models/puppy/puppy.sdf" in inside
    assert not [name for name in inside if name.startswith(("tests", "studies"))]


def test_the_installed_package_is_the_wheel_and_finds_its_own_files(python: Path, tmp_path: Path) -> None:
    code = ("import workbench; from workbench.robot import data_file, resolve_model;"
            "print(workbench.__file__, resolve_model('package://puppy/puppy.sdf'), data_file('robotis_walk.csv'), sep='\\n')")
    done = _run([str(python), "-c", code], tmp_path)
    for line in done.stdout.splitlines():
        assert Path(line).is_file()
        assert Path(line).resolve().is_relative_to(python.parents[1].resolve())


def test_another_drake_project_adds_the_servos_to_its_own_plant(python: Path, tmp_path: Path) -> None:
    project = shutil.copy(ROOT / "tests" / "example_project" / "main.py", tmp_path)
    done = _run([str(python), "-W", "error", str(project)], tmp_path)
    neck, height = map(float, done.stdout.split())
    assert neck == pytest.approx(0.3, abs=0.02)  # the servo's margin and the head's weight
    assert 0.15 < height < 0.20  # it stands
    assert done.stderr == ""  # Drake says its warnings there


def test_the_command_is_installed(python: Path, tmp_path: Path) -> None:
    done = _run([str(python.with_name("workbench")), "inspect", "package://puppy/puppy.sdf"], tmp_path)
    assert "15: blb blm blt" in done.stdout
    assert _run([str(python.with_name("workbench")), "--version"], tmp_path).stdout.startswith("workbench 0.")


@pytest.mark.slow
def test_the_demo_runs_from_the_wheel_in_an_empty_folder(python: Path, tmp_path: Path) -> None:
    done = _run([str(python.with_name("workbench")), "demo"], tmp_path, 1500)
    assert "wrote runs/demo" in done.stdout
    assert (tmp_path / "runs/demo/report.html").stat().st_size > 100_000


def test_the_source_distribution_builds_what_the_repository_has(sources: Path) -> None:
    with tarfile.open(sources) as tar:
        inside = {name.partition("/")[2] for name in tar.getnames()}
    tracked = _run(["git", "ls-files"], ROOT).stdout.split()
    assert not {name for name in tracked if (ROOT / name).is_file()} - inside


def _run(command: list[str], cwd: Path | None = None, timeout: float = 300) -> subprocess.CompletedProcess[str]:
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=timeout, check=False)
    assert done.returncode == 0, f"{' '.join(command[:4])}: {done.stdout}{done.stderr}"
    return done
