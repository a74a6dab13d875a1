"""A free base stood on the floor, and a robot put back to where it was recorded; see `workbench.simulation.steady`."""

from __future__ import annotations

import math

from workbench.simulation.compiled.arrays import Schedule, Servos, Shapes, State, Tree, Work
from workbench.simulation.compiled.contact import lowest
from workbench.simulation.compiled.kernel import part
from workbench.simulation.compiled.tree import place_bodies
from workbench.simulation.compiled.vectors import (
    Four,
    quat_about_z,
    quat_heading,
    quat_inverse,
    quat_of,
    quat_of_vector,
    quat_product,
    quat_unit,
    rotation_vector,
)
from workbench.simulation.steady import BESIDE

_BESIDE = float(BESIDE)


@part
def write_quat(state: State, a: Four) -> None:
    """Turns the base so."""
    state.base[0], state.base[1], state.base[2], state.base[3] = a


@part
def drop(tree: Tree, shapes: Shapes, state: State, w: Work) -> None:
    """Stands the robot level, its lowest box on the floor."""
    for k in range(7):
        state.base[k] = 1.0 if k == 0 else 0.0
    place_bodies(tree, state, w)
    state.base[6] = -lowest(tree, shapes, True, w)


@part
def put(tree: Tree, shapes: Shapes, schedule: Schedule, k: int, rest: Four, state: State, w: Work) -> None:
    """The base to recorded state number k; w.turned (heading, x, y of where, by which the log is turned back) takes it in. rest:
    the base's rotation before the first command."""
    a = quat_unit(quat_of(state.base))
    told = (schedule.put_quat[k, 0], schedule.put_quat[k, 1], schedule.put_quat[k, 2], schedule.put_quat[k, 3])
    recorded = quat_product(quat_unit(told), rest)
    heading = quat_heading(recorded) - quat_heading(a)
    facing = quat_product(quat_about_z(heading), a)
    x, y, z = rotation_vector(quat_product(recorded, quat_inverse(facing)))
    taken = 1.0 - 1.0 / (1.0 + (math.sqrt(x * x + y * y + z * z) / _BESIDE) ** 4)
    place_bodies(tree, state, w)
    depth = lowest(tree, shapes, False, w)
    write_quat(state, quat_unit(quat_product(quat_of_vector(taken * x, taken * y, taken * z), facing)))
    place_bodies(tree, state, w)
    state.base[6] += depth - lowest(tree, shapes, False, w)
    c, s = math.cos(heading), math.sin(heading)
    for i in range(2):
        along, left = state.v[3 * i], state.v[3 * i + 1]
        state.v[3 * i], state.v[3 * i + 1] = c * along - s * left, s * along + c * left
    for i in range(3):
        state.v[i] += taken * (schedule.put_w[k, i] - state.v[i])
        state.v[3 + i] += taken * (schedule.put_v[k, i] - state.v[3 + i])
    _turn_back(w, heading, state.base[4], state.base[5])


@part
def _turn_back(w: Work, heading: float, x: float, y: float) -> None:
    """After what w.turned (angle, shift x, y) does to a path, a turn by -heading about (x, y), which comes first."""
    c, s = math.cos(heading), math.sin(heading)
    shift_x, shift_y = x - (c * x + s * y), y - (c * y - s * x)
    c, s = math.cos(w.turned[0]), math.sin(w.turned[0])
    w.turned[1] += c * shift_x - s * shift_y
    w.turned[2] += s * shift_x + c * shift_y
    w.turned[0] -= heading


@part
def put_servos(servos: Servos, schedule: Schedule, k: int, state: State) -> None:
    """Moves the servos of a held robot to recorded state number k; ramps, and joints between servos and links, are unchanged."""
    for i in range(servos.joint.shape[0]):
        j = servos.joint[i]
        if not math.isnan(schedule.put_q[k, i]):
            state.q[j] = schedule.put_q[k, i] + servos.zero[i]
            state.v[j] = schedule.put_qdot[k, i]
            for m in range(4):
                state.memory[m, i] = 0.0
    state.stepped[0] = 0.0
