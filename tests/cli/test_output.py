"""Results appear whole or not at all, and whether they can appear is known before the work."""

import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from workbench.cli.output import output_directory
from workbench.files import InputError
from workbench.files.reading import write_whole
from workbench.robot import puppy_model, save_model


def test_appears_at_the_end_and_whole(tmp_path: Path) -> None:
    out = tmp_path / "runs" / "a"
    with output_directory(out) as folder:
        (folder / "deep").mkdir()
        (folder / "deep" / "x.csv").write_text("1")
        (folder / "y.csv").write_text("2")
        assert not out.exists()
    assert (out / "deep" / "x.csv").read_text() == "1"
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["a", "deep", "runs", "x.csv", "y.csv"]


def test_nothing_remains_of_work_that_failed(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="defect"):
        _fail(tmp_path / "runs" / "a", RuntimeError("defect"))
    assert not list(tmp_path.iterdir())


def test_failed_work_leaves_earlier_results_alone(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("old")
    with pytest.raises(KeyboardInterrupt):
        _fail(tmp_path, KeyboardInterrupt())
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("x.csv", "old")]


def test_replaces_files_of_the_same_name_and_keeps_others(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("old")
    (tmp_path / "mine.txt").write_text("kept")
    with output_directory(tmp_path) as folder:
        (folder / "x.csv").write_text("new")
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {"x.csv": "new", "mine.txt": "kept"}


@pytest.mark.parametrize("below", ["", "sub/dir"])
def test_a_path_under_a_file_is_refused_before_the_work(tmp_path: Path, below: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file"), output_directory(tmp_path / "file" / below):
        pytest.fail("the work began")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_folder_without_write_permission_is_refused_before_the_work() -> None:
    with pytest.raises(InputError, match=r"/proc/workbench: cannot be written \("), output_directory(Path("/proc/workbench")):
        pytest.fail("the work began")


def test_no_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> str:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.mkdtemp", refuse)  # root may write anywhere, so the refusal is acted
    with pytest.raises(InputError, match="Permission denied"), output_directory(tmp_path / "a"):
        pytest.fail("the work began")


def test_a_disk_that_fills_up_while_publishing_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "rename", full)
    with pytest.raises(InputError, match="No space left"), output_directory(tmp_path / "a") as folder:
        (folder / "x").write_text("1")
    assert not list(tmp_path.iterdir())


@contextmanager
def _largest_file(size: int) -> Iterator[None]:
    """No file of this process grows beyond `size` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("write", [
    lambda path: path.write_bytes(bytes(1 << 20)), lambda path: write_whole(path, bytes(1 << 20)),
    lambda path: save_model(replace(puppy_model(), packages={f"p{k}": "/tmp" for k in range(20_000)}), path)])
def test_a_file_that_cannot_be_written_whole_is_one_line_and_leaves_nothing(
        tmp_path: Path, write: Callable[[Path], object]) -> None:
    with pytest.raises(InputError, match=r"a(/x)?: cannot be written \(File too large\)"):
        _fill_small(tmp_path / "a", write)
    assert not list(tmp_path.iterdir())


def _fill_small(out: Path, write: Callable[[Path], object]) -> None:
    with output_directory(out) as folder:
        (folder / "first").write_text("1")
        with _largest_file(1 << 16):
            write(folder / "x")


def _fail(out: Path, error: BaseException) -> None:
    with output_directory(out) as folder:
        (folder / "x.csv").write_text("half")
        raise error


def _fill(out: Path) -> None:
    with output_directory(out) as folder:
        (folder / "a.txt").write_text("a")
        (folder / "b.txt").write_text("b")
        (folder / "sub").mkdir()
        (folder / "sub/c.txt").write_text("c")


@pytest.mark.parametrize(("made", "said"), [
    (lambda out: (out / "b.txt").mkdir(parents=True), "b.txt: cannot be written (a folder has this name)"),
    (lambda out: (out.mkdir(), (out / "sub").write_text("x")), "is a file)")])
def test_nothing_appears_where_one_name_is_taken(tmp_path, made, said):
    out = tmp_path / "out"
    made(out)
    before = sorted(out.rglob("*"))
    with pytest.raises(InputError) as caught:
        _fill(out)
    assert said in str(caught.value)
    assert sorted(out.rglob("*")) == before
    assert not list(tmp_path.glob(".workbench-*"))


def test_a_block_that_writes_nothing_makes_no_folder(tmp_path):
    with output_directory(tmp_path / "out"):
        pass
    assert not (tmp_path / "out").exists()
