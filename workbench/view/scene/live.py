"""A robot, a take or a session's take in live Meshcat: a page of Drake's own server, open in a browser while this process
runs."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from functools import singledispatch

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation, MeshcatParams, Rgba
from pydrake.math import RigidTransform, RotationMatrix

from workbench.compare.compare_session import roll_out, run_of
from workbench.compare.session import Session
from workbench.compare.session_takes import read_takes, register_takes
from workbench.files import InputError
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import SimulationConfig
from workbench.types import Progress, no_progress
from workbench.view.playback import Playback, common_span, play
from workbench.view.shapes import RobotShapes, robot_shapes

FRAME_RATE = 30.0
GHOST = Rgba(0.85, 0.37, 0.0, 0.4)
"""Offset of the recorded robot from the simulated one."""
FINEST = 0.01
"""Step of a joint's slider [rad]."""


def open_meshcat(port: int | None = None) -> Meshcat:
    """Drake's Meshcat server, on the first free port from 7000 on, or on `port`. InputError where that one is taken."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(logging.WARNING)  # the caller reports the address
    try:
        return Meshcat(MeshcatParams(port=port, show_stats_plot=False))
    except RuntimeError as e:
        raise InputError(f"port {port}", f"Meshcat cannot be served there ({e})") from None
    finally:
        log.setLevel(level)


@singledispatch
def show(subject: object, meshcat: Meshcat | None = None) -> Meshcat:
    """Puts a RobotModel, or a Session's first take, into Meshcat and returns it; `.web_url()` is its address. meshcat: the server
    to use; None: a new one, on the first free port from 7000 on, while this process lives. A take of your own is shown by
    `workbench.view.scene.live.show_take`, which takes the model. InputError for anything else.
    """
    raise InputError(None, f"show: expected a RobotModel or a Session, got {type(subject).__name__}")


@show.register
def _(subject: RobotModel, meshcat: Meshcat | None = None) -> Meshcat:
    meshcat = meshcat or open_meshcat()
    shapes = robot_shapes(subject)
    _add_robot(meshcat, "robot", shapes, None)
    pose(meshcat, subject, np.zeros(len(subject.joints)))
    return meshcat


@show.register
def _(subject: Session, meshcat: Meshcat | None = None) -> Meshcat:
    return show_session(subject, meshcat=meshcat)


def pose(meshcat: Meshcat, model: RobotModel, q: np.ndarray) -> None:
    """Moves the robot that `show` put there: joints at q (n,) [rad], in the model's order."""
    for link, X_WL in link_poses(model, q).items():
        meshcat.SetTransform(f"/robot/{link}", X_WL)


def link_poses(model: RobotModel, q: np.ndarray) -> dict[str, RigidTransform]:
    """X_WL of each link with the joints at q (n,) [rad], the robot just clear of the floor."""
    take = Take("pose", "simulation", np.zeros(1), model.joints, np.asarray(q, dtype=float)[None], base="fixed")
    played = play(take, model, np.zeros(1))
    world = {link: played.in_world(link) for link in played.links}
    return {link: RigidTransform(RotationMatrix(R[0]), p[0]) for link, (p, R) in world.items()}


def pose_by_sliders(meshcat: Meshcat, model: RobotModel, wait: Callable[[], bool]) -> None:
    """Gives the page a slider [deg] for each joint and moves the robot by them for as long as `wait` returns True."""
    for joint in model.joints:
        frame = model.kinematics.frames[joint]
        low, high = (np.degrees(np.clip(x, -np.pi, np.pi)) for x in (frame.lower, frame.upper))
        meshcat.AddSlider(joint, low, high, np.degrees(FINEST), float(np.clip(0.0, low, high)))
    shown = None
    while wait():
        q = np.radians([meshcat.GetSliderValue(joint) for joint in model.joints])
        if shown is None or not np.array_equal(q, shown):
            pose(meshcat, model, q)
            shown = q


def show_take(model: RobotModel, simulated: Take, recorded: Take | None = None, meshcat: Meshcat | None = None) -> Meshcat:
    """Plays a take in Meshcat, in a loop, with the page's own controls; `recorded` is laid over it as a ghost."""
    meshcat = meshcat or open_meshcat()
    takes = [simulated] if recorded is None else [simulated, recorded]
    first, last = common_span(takes)
    time = np.arange(first, last, 1 / FRAME_RATE)
    shapes, animation = robot_shapes(model), MeshcatAnimation(FRAME_RATE)
    played = play(simulated, model, time)
    _animate(meshcat, animation, "simulated", shapes, played, None)
    if recorded is not None:
        _animate(meshcat, animation, "recorded", shapes, play(recorded, model, time, like=(simulated, played)), GHOST)
    animation.set_autoplay(True)
    animation.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    animation.set_repetitions(1_000_000)
    meshcat.SetAnimation(animation)
    return meshcat


def show_session(session: Session, take: str | None = None, meshcat: Meshcat | None = None,
                 progress: Progress = no_progress) -> Meshcat:
    """Simulates one take of a session (default: its first) and plays it with the recording as a ghost. InputError for a take that
    the session has not, or that cannot be read."""
    names = [t.name for t in session.takes]
    if not names:
        raise InputError(session.path, "takes: expected at least one to show")
    if take is not None and take not in names:
        raise InputError(session.path, f"no take '{take}'; expected one of {', '.join(names)}")
    alone = replace(session, takes=tuple(t for t in session.takes if t.name == (take or names[0])))
    takes, left_out = read_takes(alone)
    rollouts = roll_out([run_of(t) for t in takes], SimulationConfig(), progress=progress, n_jobs=1, floors=False)
    registered, unregistered = register_takes(alone, takes, {t.spec.name: r.nominal for t, r in zip(takes, rollouts)}, progress)
    if not registered:
        raise InputError(session.path, "; ".join(f"{name}: {reason}" for name, reason in left_out + unregistered))
    return show_take(registered[0].model, registered[0].observe(rollouts[0].nominal), registered[0].recorded, meshcat)


def _add_robot(meshcat: Meshcat, name: str, shapes: RobotShapes, colour: Rgba | None) -> None:
    """Its links' shapes under /name/LINK, in their own colours or in one."""
    for link, visuals in shapes.visuals.items():
        for i, visual in enumerate(visuals):
            at = f"/{name}/{link}/{i}"
            if visual.mesh is None:
                meshcat.SetObject(at, visual.shape, colour or visual.rgba)
            else:
                for k, part in enumerate(shapes.meshes[visual.mesh]):
                    vertices, faces = np.asfortranarray(part.vertices.T), np.asfortranarray(part.faces.T)
                    meshcat.SetTriangleMesh(f"{at}/{k}", vertices, faces, colour or part.rgba)
            meshcat.SetTransform(at, visual.X_LG)


def _animate(meshcat: Meshcat, animation: MeshcatAnimation, name: str, shapes: RobotShapes, played: Playback,
             colour: Rgba | None) -> None:
    _add_robot(meshcat, name, shapes, colour)
    for link in played.links:
        p, R = played.in_world(link)
        meshcat.SetTransform(f"/{name}/{link}", RigidTransform(RotationMatrix(R[0]), p[0]))
        for k in range(len(played.time)):
            animation.SetTransform(k, f"/{name}/{link}", RigidTransform(RotationMatrix(R[k]), p[k]))
