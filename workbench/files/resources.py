"""Where models and data are, in a source tree and in an installed wheel, and how Drake finds them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from workbench.files.errors import InputError

if TYPE_CHECKING:
    from pydrake.multibody.parsing import PackageMap, Parser

ROBOTS = ("fox", "puppy")
"""Drake packages that ship in models/sdf."""
_PACKAGE = Path(__file__).resolve().parents[1]


def resource_dir(kind: str) -> Path:
    """Folder of `kind` ("models", "data" or "firmware"): inside the wheel if installed, else at the top of the source tree."""
    inside = _PACKAGE / "resources" / kind
    return inside if inside.is_dir() else _PACKAGE.parent / {"models": "models/sdf"}.get(kind, kind)


def data_file(name: str) -> Path:
    """A file that ships with the workbench, by its name inside data/."""
    return resource_dir("data") / name


def ConfigurePackageMap(package_map: PackageMap) -> None:
    """Makes `package://puppy/...` and the other robots that ship known to Drake."""
    for robot in ROBOTS:
        if not package_map.Contains(robot):
            package_map.AddPackageXml(str(resource_dir("models") / robot / "package.xml"))


def ConfigureParser(parser: Parser) -> None:
    """Makes `package://puppy/puppy.sdf` and `package://fox/fox.sdf` loadable by a caller's parser."""
    ConfigurePackageMap(parser.package_map())


def resolve_model(description: str | Path) -> Path:
    """The file behind a path or a `package://` URL; InputError if there is none."""
    text = str(description)
    if text.startswith("package://"):
        from pydrake.multibody.parsing import PackageMap

        package, _, rest = text.removeprefix("package://").partition("/")
        package_map = PackageMap()
        ConfigurePackageMap(package_map)
        if not package_map.Contains(package):
            raise InputError(text, f"no package '{package}' is known; expected one of {', '.join(ROBOTS)}, or a path")
        path = Path(package_map.GetPath(package)) / rest
    else:
        path = Path(text)
    if not path.is_file():
        raise InputError(text, f"model file not found; expected {', '.join(ROBOTS)}, or a file")
    return path.resolve()
