"""Problems of a robot that Drake has built: a base without mass, inertias and lengths of another unit, no feet."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import InputError
from workbench.files.reading import cached_by_content
from workbench.physical import GROUND
from workbench.types import Array


@dataclass(frozen=True)
class ModelChecks:
    """dummy: a link of at most this mass is a mere frame, whose inertia does not matter [kg]. outside: how far a
    centre of mass may lie outside the box about its link's shapes and joints, in diagonals of that. gyration: of a link's
    radius of gyration to its reach at most. smallest: a link's reach is taken as at least so much [m]. dense: no link of its
    reach weighs more [kg/m^3]; lead is 11,300. longest: of a small robot's link [m]."""

    dummy: float = 1e-5
    outside: float = 1.0
    gyration: float = 1.5
    smallest: float = 0.03
    dense: float = 12000.0
    longest: float = 5.0


CHECKS = ModelChecks()


def drake_error(error: Exception) -> str:
    """Drake's message without locations in its own source and without the file's path, which the caller names."""
    text = re.sub(r"Failure at \S+ in \w+\(\): ", "", str(error))
    text = re.sub(r"(?:^|\s)/?\S*?:(\d+): error: ", r" line \1: ", text)
    return " ".join(text.split())[:600]


class _Errors(logging.Handler):
    """Collects what Drake logs as errors: values that its parser ignores without raising."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.found: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.found.append(re.sub(r"^.*?Msg: ", "", record.getMessage()))


@contextmanager
def quiet_drake() -> Iterator[None]:
    """Drake's warnings about a description become problems, rather than lines on stderr. RuntimeError where it logs an error and
    does not stop."""
    log, errors = logging.getLogger("drake"), _Errors()
    passes = log.propagate
    log.addHandler(errors)
    log.propagate = False
    try:
        yield
    finally:
        log.removeHandler(errors)
        log.propagate = passes
    if errors.found:
        raise RuntimeError(errors.found[0])


def _build(path: Path, source: Path) -> tuple[Any, Any, list[Any]]:
    """Plant, scene graph and model instances that Drake makes of `path`; InputError names `source` where it makes none."""
    from pydrake.geometry import SceneGraph
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    from workbench.files.resources import ConfigureParser

    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    parser = Parser(plant)
    ConfigureParser(parser)
    try:
        with quiet_drake():
            instances = parser.AddModels(str(path))
            plant.Finalize()
    except (RuntimeError, ValueError) as e:
        raise InputError(source, f"Drake cannot read this model: {drake_error(e)}") from None
    return plant, scene_graph, instances


@cached_by_content(maxsize=32)
def model_problems(path: Path, source: Path, held: str = "", slides: bool = False) -> tuple[str, ...]:
    """A line for each thing that is doubtful in the robot that Drake makes of `path`; InputError names `source` where it makes
    none. held: link whose mass does not matter, as it is held wherever the robot is used; then it need not stand either. slides:
    whether the description's own friction acts on the ground; InputError where that is impossible."""
    plant, scene_graph, instances = _build(path, source)
    if len(instances) != 1:
        return ()
    bodies = [plant.get_body(b) for b in plant.GetBodyIndices(instances[0])]
    groups = _fixed_together(plant)
    groups = {name: group for name, group in groups.items() if held not in group}
    feet = () if held else _feet(plant, bodies)
    rubs = _rubs(plant, scene_graph, bodies, source) if slides and not held else ()
    return (*_without_mass(plant, groups), *_unlikely(plant, scene_graph, bodies, held), *feet, *rubs)


@cached_by_content(maxsize=32)
def link_sizes(path: Path) -> dict[str, float]:
    """Size of each link: the largest distance between two of its shapes' corners, its centre of mass, its joint and the next ones
    [m], at least `ModelChecks.smallest`; InputError where Drake cannot read the SDF at `path`."""
    plant, scene_graph, instances = _build(path, path)
    bodies = [plant.get_body(b) for instance in instances for b in plant.GetBodyIndices(instance)]
    out = {}
    for body in bodies:
        points = _points(plant, scene_graph, body)
        apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
        out[body.name()] = max(float(apart.max(initial=0.0)), CHECKS.smallest)
    return out


def _fixed_together(plant: Any) -> dict[str, set[str]]:
    """The bodies that are welded to each but to the world, itself among them, by name."""
    from pydrake.multibody.tree import BodyIndex

    out = {}
    for index in range(1, plant.num_bodies()):
        group = plant.GetBodiesWeldedTo(plant.get_body(BodyIndex(index)))
        if all(b.index() != plant.world_body().index() for b in group):
            out[plant.get_body(BodyIndex(index)).name()] = {b.name() for b in group}
    return out


def _without_mass(plant: Any, groups: dict[str, set[str]]) -> Iterator[str]:
    floating = {plant.get_body(b).name() for b in plant.GetFloatingBaseBodies()}
    reported: set[str] = set()
    for name, group in groups.items():
        mass = sum(plant.GetBodyByName(n).default_mass() for n in group)
        if mass > 0 or reported & group:
            continue
        reported |= group
        if floating & group:
            yield f"link '{name}': the base floats and weighs nothing (with all that is fixed to it)"
        else:
            yield f"link '{name}' has no mass, nor do the links fixed to it, though a joint moves it"


def _unlikely(plant: Any, scene_graph: Any, bodies: list[Any], held: str) -> Iterator[str]:
    reaches = {b.name(): _reach(plant, scene_graph, b) for b in bodies}
    overall = max(reaches.values(), default=0.0)
    for body in bodies:
        name, mass, reach = body.name(), body.default_mass(), reaches[body.name()]
        if reach > CHECKS.longest:
            yield f"link '{name}' reaches {reach:.3g} m from its frame: are lengths in millimetres?"
        if mass <= CHECKS.dummy or name == held:
            continue
        yield from _centre_outside(plant, scene_graph, body)
        about = body.default_rotational_inertia().CopyToFullMatrix3()
        c = body.default_com()
        central = about - mass * (c @ c * np.eye(3) - np.outer(c, c))
        gyration = float(np.sqrt(max(np.linalg.eigvalsh(central).max(), 0.0) / mass))
        if gyration > CHECKS.gyration * max(reach or overall, CHECKS.smallest):
            largest = float(np.linalg.eigvalsh(central).max())
            yield (f"link '{name}': an inertia of {largest:.3g} kg m^2 on {mass:.3g} kg is that of a body "
                   f"{2 * gyration:.2g} m wide; the link reaches {reach or overall:.2g} m")
        if mass > CHECKS.dense * max(reach, CHECKS.smallest) ** 3:
            yield (f"link '{name}' weighs {mass:.4g} kg and reaches {reach:.2g} m: heavier than lead; are masses in grams, or "
                   "lengths in another unit?")


def _centre_outside(plant: Any, scene_graph: Any, body: Any) -> Iterator[str]:
    """Whether a link's centre of mass lies far outside all that the description says of its extent."""
    points = _points(plant, scene_graph, body)[1:]  # the first is the centre itself
    if len(points) < 2:
        return
    lower, upper, c = points.min(axis=0), points.max(axis=0), body.default_com()
    size = max(float(np.linalg.norm(upper - lower)), CHECKS.smallest)
    away = float(np.linalg.norm(c - np.clip(c, lower, upper)))
    if away > CHECKS.outside * size:
        x, y, z = c
        yield (f"link '{body.name()}': its centre of mass at {x:.3g} {y:.3g} {z:.3g} m lies {away:.2g} m outside its shapes "
               f"and joints, "
               f"which are {size:.2g} m across: is its origin in millimetres, or in another frame?")


def _reach(plant: Any, scene_graph: Any, body: Any) -> float:
    """How far a link's shapes, centre of mass and joints are from its frame [m]."""
    return float(np.linalg.norm(_points(plant, scene_graph, body), axis=1).max(initial=0.0))


def _points(plant: Any, scene_graph: Any, body: Any) -> Array:
    """A link's ends: its centre of mass, the corners of its shapes' boxes, its joint and the next ones, (N, 3) [m] in its
    frame."""
    from pydrake.geometry import HalfSpace, Role

    inspector = scene_graph.model_inspector()
    points = [body.default_com()] if body.default_mass() > 0 else []
    frame = plant.GetBodyFrameIdOrThrow(body.index())
    for role in (Role.kProximity, Role.kIllustration):
        for g in inspector.GetGeometries(frame, role):
            if isinstance(inspector.GetShape(g), HalfSpace):
                continue
            box = inspector.GetObbInGeometryFrame(g)
            X = inspector.GetPoseInFrame(g).multiply(box.pose())
            points += [X.multiply(box.half_width() * signs) for signs in product((-1.0, 1.0), repeat=3)]
    for joint in map(plant.get_joint, plant.GetJointIndices()):
        for end, on in ((joint.parent_body(), joint.frame_on_parent()), (joint.child_body(), joint.frame_on_child())):
            if end.index() == body.index():
                points.append(on.GetFixedPoseInBodyFrame().translation())
    return np.reshape(points, (-1, 3)).astype(float)


def _rubs(plant: Any, scene_graph: Any, bodies: list[Any], source: Path) -> Iterator[str]:
    """Doubtful friction of links; InputError for an impossible one."""
    inspector = scene_graph.model_inspector()
    for body in bodies:
        for g in plant.GetCollisionGeometriesForBody(body):
            friction = own_friction(inspector.GetProximityProperties(g))
            try:
                check_own_friction(body.name(), friction)
            except InputError as e:
                raise InputError(source, e.problem) from None
            if friction is not None and (doubt := GROUND["friction"].doubt(friction)) is not None:
                yield f"link '{body.name()}': friction: {doubt}"
                break


def own_friction(properties: Any) -> float | None:
    """Dynamic friction among a shape's proximity properties, which acts between steps; None where there is none."""
    if not properties.HasProperty("material", "coulomb_friction"):
        return None
    return float(properties.GetProperty("material", "coulomb_friction").dynamic_friction())


def check_own_friction(link: str, friction: float | None) -> None:
    """InputError where the friction that a description gives a link's shape is impossible."""
    text = None if friction is None else GROUND["friction"].problem(friction)
    if text is not None:
        raise InputError(None, f"link '{link}': friction: {text}; correct it, or state the ground's own friction in the session, "
                               "which replaces it")


def _feet(plant: Any, bodies: list[Any]) -> Iterator[str]:
    if plant.GetFloatingBaseBodies() and not any(plant.GetCollisionGeometriesForBody(b) for b in bodies):
        yield "no link has a collision shape: a robot whose base floats falls through the ground"
