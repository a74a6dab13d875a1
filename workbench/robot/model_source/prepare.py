"""Prepares the user's description for Drake."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from workbench.files import InputError
from workbench.files.reading import write_whole
from workbench.robot.model_source.meshes import READ, drake_mesh, find_mesh
from workbench.robot.model_source.structure import check_structure
from workbench.robot.model_source.unsupported_joints import stand_on_world, without_mimics
from workbench.robot.model_source.urdf import sdf_of_urdf
from workbench.robot.model_source.xml_file import check_includes, check_numbers, read_xml

NAME = "drake-workbench"
"""Folder of the user's cache, one for all that the workbench keeps."""
_NAMES: dict[str, str] = {}
"""The user's file by the file made from it, so that errors can name it."""


@dataclass(frozen=True)
class ModelSource:
    """source: the user's file. path: file that Drake reads, the same or an SDF made of it. problems: of the file, and notes:
    changes made for Drake, one line each."""

    source: Path
    path: Path
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def user_file(path: Path) -> Path:
    """The user's file of which `path` was made; `path` itself where it is that."""
    return Path(_NAMES.get(str(path), path))


def prepare(source: Path, packages: Mapping[str, str] | None = None) -> ModelSource:
    """Reads a description once, checks it, and converts parts that Drake cannot read, in the user's cache.

    packages: folder of each ROS package that mesh URIs name. InputError names file, link or joint, and the expected value.
    """
    try:
        content = source.read_bytes() if source.is_file() else b""
    except OSError:
        content = b""
    done = _prepare(source, hashlib.sha256(content).hexdigest(), tuple(sorted((packages or {}).items())))
    _NAMES[str(done.path)] = str(source)
    return done


@lru_cache(maxsize=64)
def _prepare(source: Path, digest: str, packages: tuple[tuple[str, str], ...]) -> ModelSource:
    root = read_xml(source)
    check_numbers(source, root)
    notes: list[str] = []
    problems: list[str] = []
    changed = root.tag == "robot"
    if changed:
        root, problems = sdf_of_urdf(root, source)
        notes.append("URDF, written as SDF")
    else:
        check_includes(source, root)
    stands, alone = stand_on_world(root), without_mimics(root)
    notes += stands
    problems += [*alone, *check_structure(source, root)]
    changed |= bool(stands or alone)
    cache = cache_folder() / "models"
    made, moved = _with_meshes(root, source, dict(packages), cache, moved=source.suffix.lower() != ".sdf")
    notes += [f"{n} {kind} mesh(es) made OBJ for Drake" for kind, n in made.items()]
    if not (changed or made or moved):
        return ModelSource(source, source, tuple(problems), tuple(notes))
    text = ElementTree.tostring(root, encoding="unicode")
    name = f"{source.stem}-{hashlib.sha256(text.encode()).hexdigest()[:16]}.sdf"
    if not (cache / name).is_file():
        write_whole(cache / name, text)
    return ModelSource(source, cache / name, tuple(problems), tuple(notes))


def _with_meshes(root: Element, source: Path, packages: Mapping[str, str], cache: Path,
                 moved: bool) -> tuple[Counter[str], bool]:
    """Sets each mesh's URI to a file that is there and that Drake reads; how many were converted, by kind, and whether any URI is
    not as it was. moved: the description is written to another folder anyway, as Drake takes its kind from its file's name."""
    made: Counter[str] = Counter()
    for link in root.iter("link"):
        place = f"link '{link.get('name', '')}'"
        for uri in link.iter("uri"):
            text = (uri.text or "").strip()
            if not text:
                raise InputError(source, f"{place}: mesh: expected a file's name in <uri>")
            found = find_mesh(source, place, text, packages)
            path = drake_mesh(found, source, place, cache)
            if path != found:
                made[found.suffix[1:].upper()] += 1
            plain = text.startswith("package://puppy/") or (path == found and "://" not in text and "\\" not in text)
            if not plain or path.suffix.lower() not in READ:
                uri.text, moved = f"file://{path}", True
    if moved or made:
        for uri in root.iter("uri"):
            text = (uri.text or "").strip()
            if "://" not in text:
                uri.text = f"file://{(source.parent / text).resolve()}"
    return made, moved


def cache_folder() -> Path:
    """Cache of converted files, in the same folder as the compiled rollouts: drake-workbench in XDG_CACHE_HOME or ~/.cache,
    or where that cannot be written, in the temporary folder."""
    for root in (os.environ.get("XDG_CACHE_HOME"), os.path.expanduser("~/.cache")):
        if root and os.path.isabs(root):
            folder = Path(root) / NAME
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError:
                continue
            if os.access(folder, os.W_OK):
                return folder
    return Path(tempfile.gettempdir()) / f"{NAME}-{os.getuid()}"
