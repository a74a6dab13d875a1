"""Locates the meshes of a description, and converts them to a format that Drake reads."""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from workbench.files import InputError
from workbench.files.kinds import lfs_pointer
from workbench.files.reading import regular_file, write_whole
from workbench.files.resources import resource_dir

READ = (".obj", ".gltf", ".glb", ".vtk")
"""Formats that Drake reads directly."""
CONVERTED = (".stl", ".dae", ".ply", ".off", ".3mf")
"""Formats that trimesh converts to OBJ."""
_UP = 6
"""Number of folders above the model's that are searched for a package."""
_MOST = 256 << 20  # of one mesh [bytes]


def find_mesh(model: Path, place: str, uri: str, packages: Mapping[str, str]) -> Path:
    """The file behind a mesh's URI. model: the description's file. place: link that names it, for errors. packages: folder of
    each ROS package. A package that is not given is looked for among the folders above the model, and in ROS_PACKAGE_PATH;
    one without a name is the model's own folder. InputError where there is no such file."""
    text = uri.strip().replace("\\", "/")
    scheme, colon, rest = text.partition("://")
    if not colon:
        scheme, rest = "", text
    folders: tuple[Path, ...]
    if scheme in ("", "file"):
        folders, name, inner = (model.parent if scheme == "" else Path("/"),), "", rest
    elif scheme in ("package", "model"):
        name, _, inner = rest.partition("/")
        folders = tuple(_package_folders(model, name, packages))
    else:
        raise InputError(model, f"{place}: mesh '{uri}': expected a file, file://, package:// or model://")
    for folder in folders:
        found = folder / (inner if scheme in ("", "file") else inner.lstrip("/"))
        if found.is_file():
            return found.resolve()
    hint = ""
    if name and name not in packages:
        hint = f"; name the folder of the package by --package {name}=DIR or, in a session, robot: packages: {{{name}: DIR}}"
    elif name:
        hint = f" in {packages[name]}"
    raise InputError(model, f"{place}: mesh '{uri}': file not found{hint}")


def _package_folders(model: Path, name: str, packages: Mapping[str, str]) -> Iterator[Path]:
    above = [model.parent, *list(model.parents)[1:_UP]]
    if not name:
        yield from above
    elif name in packages:
        yield Path(packages[name])
    else:
        if name == "puppy":
            yield resource_dir("models") / "puppy"
        for folder in above:
            if folder.name == name or _declares(folder, name):
                yield folder
            yield folder / name
        for root in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep):
            if root:
                yield Path(root) / name


def _declares(folder: Path, name: str) -> bool:
    """Whether a ROS package of that name lies in the folder."""
    try:
        return (folder / "package.xml").is_file() and ElementTree.parse(folder / "package.xml").findtext("name") == name
    except (ElementTree.ParseError, OSError):
        return False


def drake_mesh(path: Path, model: Path, place: str, cache: Path) -> Path:
    """A mesh that Drake reads: the file itself, or an OBJ made of it in `cache`. InputError where it holds no triangles."""
    kind = path.suffix.lower()
    if kind in READ:
        with regular_file(path, _MOST).open("rb") as file:
            pointer = lfs_pointer(file.read(200))
        if pointer is not None:
            raise InputError(model, f"{place}: mesh '{path.name}': {pointer}")
        return path
    if kind not in CONVERTED:
        raise InputError(model, f"{place}: mesh '{path.name}': expected {', '.join(x[1:].upper() for x in READ + CONVERTED)}")
    content = regular_file(path, _MOST).read_bytes()
    if (pointer := lfs_pointer(content[:200])) is not None:
        raise InputError(model, f"{place}: mesh '{path.name}': {pointer}")
    made = cache / f"{path.stem}-{hashlib.sha256(content).hexdigest()[:16]}.obj"
    if not made.is_file():
        write_whole(made, _triangles(path, model, place).export(file_type="obj", include_texture=False))
    return made


def _triangles(path: Path, model: Path, place: str) -> Any:
    import trimesh

    try:
        with warnings.catch_warnings(action="ignore", category=DeprecationWarning):  # pycollada 0.9 under numpy 2.5
            loaded = trimesh.load_mesh(path)
        mesh = loaded.to_geometry() if isinstance(loaded, trimesh.Scene) else loaded
        good = isinstance(mesh, trimesh.Trimesh) and len(mesh.faces) > 0 and bool(abs(mesh.vertices).max() < float("inf"))
    except Exception as e:  # trimesh has no error of its own, and each loader raises others
        raise InputError(model, f"{place}: mesh '{path.name}': damaged, or no {path.suffix[1:].upper()} "
                                f"({type(e).__name__}: {e})") from None
    if not good:
        raise InputError(model, f"{place}: mesh '{path.name}': expected triangles, found none")
    return mesh
