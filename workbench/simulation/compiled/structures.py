"""Tables of robots, of which Drake parses one for each structure; numbers of others of that structure are written into them."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from pydrake.multibody.tree import RotationalInertia, SpatialInertia

from workbench.effects.sdf import SdfRobot
from workbench.effects.sdf_values import read_inertia
from workbench.robot import RobotModel
from workbench.simulation.compiled.sdf_structure import Split, split
from workbench.simulation.compiled.tables import Tables, carried, read_tables, weigh

KEPT = 64
ENDLESS = 1e15
"""Limits that are no smaller [rad] are left to Drake, which takes such for none."""
_known: OrderedDict[tuple[object, str, bool], tuple[Split | None, Tables]] = OrderedDict()
_splits: WeakKeyDictionary[SdfRobot, Split] = WeakKeyDictionary()
_filled: WeakKeyDictionary[Split, tuple[Tables, Tables]] = WeakKeyDictionary()


def tables_of(model: RobotModel, build: SdfRobot | None, free: bool) -> Tables:
    """Of a changed SDF (None: of the model's file) on a free or held base; NotCoveredError names the part that
    is not supported."""
    parts = None if build is None else _parts(build)
    key = (hashlib.sha256(model.path.read_bytes()).digest() if parts is None else parts.structure, f"{model.path} {model.base}",
           free)
    if key not in _known:
        _known[key] = (parts, read_tables(model, None if build is None else build.text(), free))
    _known.move_to_end(key)
    while len(_known) > KEPT:
        _known.popitem(last=False)
    first, tables = _known[key]
    if parts is None or first is None or parts.says_the_same(first):
        return tables
    if parts not in _filled or _filled[parts][0] is not tables:
        written = _written(tables, first, parts)
        if written is None:
            assert build is not None
            written = read_tables(model, build.text(), free)
        _filled[parts] = (tables, written)
    return _filled[parts][1]


def _parts(build: SdfRobot) -> Split:
    """Of a changed SDF; once for each."""
    if build not in _splits:
        _splits[build] = split(build.root)
    return _splits[build]


def _written(tables: Tables, first: Split, parts: Split) -> Tables | None:
    """Tables of one robot with the numbers of another of its structure; None where a number is not one that can be written."""
    tree = tables.tree
    columns = {name: getattr(tree, name).copy() for name in ("lower", "upper", "damping", "stiffness", "rest")}
    for joint, texts in parts.joints.items():
        if texts == first.joints[joint]:
            continue
        if joint not in tables.joints:
            return None
        i = tables.joints.index(joint)
        for column, said, before in zip(columns.values(), texts, first.joints[joint]):
            if said != before:
                column[i] = float(said or "nan")
    links = list(tables.links)
    moved = [k for k, link in enumerate(links) if parts.weights.get(link.link) != first.weights.get(link.link)]
    for k in moved:
        mass, com, inertia = read_inertia(parts.inertials[links[k].link])
        about = RotationalInertia(*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2])
        M = SpatialInertia.MakeFromCentralInertia(mass, com, about)
        links[k] = replace(links[k], M=carried(M, links[k].X))
    if not all((np.abs(column[column != getattr(tree, name)]) < ENDLESS).all() for name, column in columns.items()):
        return None
    numbers: dict[str, Any] = dict(columns)
    if moved:
        numbers |= zip(("mass", "com", "inertia"), weigh(links, len(tables.joints)))
    return replace(tables, tree=tree._replace(**numbers), links=tuple(links))
