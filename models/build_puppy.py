"""Builds models/sdf/puppy from data/parts.csv and data/joint_signs.csv: `python -m models.build_puppy [FOLDER]`."""

from __future__ import annotations

import sys
from pathlib import Path

from models.puppy_assembly import links, read_parts
from models.puppy_sdf import mesh_gltf, mesh_obj, read_signs, sdf
from models.puppy_shapes import foot, part_shapes
from workbench.files.reading import write_together, write_whole

ROOT = Path(__file__).resolve().parents[1]


def build(folder: Path, parts: Path = ROOT / "data/parts.csv", signs: Path = ROOT / "data/joint_signs.csv") -> Path:
    """Writes puppy.sdf and meshes/ into `folder`; returns the SDF's path."""
    table = read_parts(parts)
    corner, radius = table.length["foot_corner"], table.length["foot_radius"]
    shapes = part_shapes(dict(table.size), corner, radius)
    meshes: dict[str, str | bytes] = {f"{name}.gltf": mesh_gltf(shape) for name, shape in shapes.items()}
    meshes["foot.obj"] = mesh_obj(foot(corner, radius))
    write_together(folder / "meshes", meshes)
    return write_whole(folder / "puppy.sdf", sdf(links(table.length), table, shapes, read_signs(signs)))


if __name__ == "__main__":
    print(build(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "models/sdf/puppy"))
