"""Kinematics and dynamics of a tree of revolute joints on a free or held base.

Composite rigid bodies and recursive Newton-Euler (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5, 6 and 8), with
all spatial vectors about one point, the root's origin, in the world's axes: nothing is carried from body to body.
"""

from __future__ import annotations

import math

from workbench.simulation.compiled.arrays import Array, Numbers, State, Tree, Work
from workbench.simulation.compiled.kernel import part
from workbench.simulation.compiled.vectors import cross, quat_of, turned, write_rotation


@part
def place_bodies(tree: Tree, state: State, w: Work) -> None:
    """Rotations R and origins p of the bodies, from the root's origin, in W."""
    n = tree.parent.shape[0]
    if tree.free:
        write_rotation(quat_of(state.base), w.R[n])
    else:
        for r in range(3):
            for c in range(3):
                w.R[n, r, c] = 1.0 if r == c else 0.0
    for r in range(3):
        w.p[n, r] = 0.0
    for i in range(n):
        a = tree.carrier[i]
        _place_body(tree, i, a, math.cos(state.q[i]), math.sin(state.q[i]), w)


@part
def _place_body(tree: Tree, i: int, a: int, c: float, s: float, w: Work) -> None:
    """R_i = R_a R_aF R(angle) by Rodrigues, and p_i, of the body on joint i that body a carries."""
    t = 1.0 - c
    ux, uy, uz = tree.axis[i, 0], tree.axis[i, 1], tree.axis[i, 2]
    xy, xz, yz = t * ux * uy, t * ux * uz, t * uy * uz
    for r in range(3):
        a0, a1, a2 = w.R[a, r, 0], w.R[a, r, 1], w.R[a, r, 2]
        f0 = a0 * tree.R[i, 0, 0] + a1 * tree.R[i, 1, 0] + a2 * tree.R[i, 2, 0]
        f1 = a0 * tree.R[i, 0, 1] + a1 * tree.R[i, 1, 1] + a2 * tree.R[i, 2, 1]
        f2 = a0 * tree.R[i, 0, 2] + a1 * tree.R[i, 1, 2] + a2 * tree.R[i, 2, 2]
        w.R[i, r, 0] = f0 * (c + t * ux * ux) + f1 * (xy + s * uz) + f2 * (xz - s * uy)
        w.R[i, r, 1] = f0 * (xy - s * uz) + f1 * (c + t * uy * uy) + f2 * (yz + s * ux)
        w.R[i, r, 2] = f0 * (xz + s * uy) + f1 * (yz - s * ux) + f2 * (c + t * uz * uz)
        w.p[i, r] = w.p[a, r] + a0 * tree.p[i, 0] + a1 * tree.p[i, 1] + a2 * tree.p[i, 2]


@part
def move_bodies(tree: Tree, state: State, w: Work) -> None:
    """Joint axes S, velocities V, and accelerations A at rest of all joints' rates, less gravity."""
    n = tree.parent.shape[0]
    o = 6 if tree.free else 0
    for k in range(6):
        w.V[n, k] = state.v[k] if tree.free else 0.0
        w.A[n, k] = 0.0
    for k in range(3):
        w.A[n, 3 + k] = -tree.gravity[k]
    if tree.free:  # the origin is a point of the base, and its spatial acceleration is not that point's
        for i in range(6):
            for k in range(6):
                w.S[i, k] = 1.0 if i == k else 0.0
        x, y, z = cross(state.v[0], state.v[1], state.v[2], state.v[3], state.v[4], state.v[5])
        w.A[n, 3] -= x
        w.A[n, 4] -= y
        w.A[n, 5] -= z
    for i in range(n):
        a = tree.carrier[i]
        _move_body(tree, i, a, o + i, state.v[o + i], w)


@part
def _move_body(tree: Tree, i: int, a: int, k: int, rate: float, w: Work) -> None:
    """S of joint i (velocity k), and its body's V = V_a + S rate and A = A_a + V x S rate."""
    ax, ay, az = turned(w.R[i], tree.axis[i, 0], tree.axis[i, 1], tree.axis[i, 2])
    bx, by, bz = cross(w.p[i, 0], w.p[i, 1], w.p[i, 2], ax, ay, az)
    w.S[k, 0], w.S[k, 1], w.S[k, 2], w.S[k, 3], w.S[k, 4], w.S[k, 5] = ax, ay, az, bx, by, bz
    for j in range(6):
        w.V[i, j] = w.V[a, j] + w.S[k, j] * rate
    wx, wy, wz = w.V[i, 0], w.V[i, 1], w.V[i, 2]
    x, y, z = cross(wx, wy, wz, ax, ay, az)
    w.A[i, 0], w.A[i, 1], w.A[i, 2] = w.A[a, 0] + x * rate, w.A[a, 1] + y * rate, w.A[a, 2] + z * rate
    x, y, z = cross(wx, wy, wz, bx, by, bz)
    lx, ly, lz = cross(w.V[i, 3], w.V[i, 4], w.V[i, 5], ax, ay, az)
    w.A[i, 3], w.A[i, 4], w.A[i, 5] = w.A[a, 3] + (x + lx) * rate, w.A[a, 4] + (y + ly) * rate, w.A[a, 5] + (z + lz) * rate


@part
def weigh_bodies(tree: Tree, w: Work) -> None:
    """Inertia of each body about the root's origin, and the force F = I A + V x* I V that its motion takes."""
    n = tree.parent.shape[0]
    for i in range(n + 1 if tree.free else n):
        _turn_inertia(tree, i, w.R[i], w)
        vx, vy, vz, lx, ly, lz = w.V[i, 0], w.V[i, 1], w.V[i, 2], w.V[i, 3], w.V[i, 4], w.V[i, 5]
        hx, hy, hz, kx, ky, kz = _momentum(w.mass[i], w.moment[i], w.inertia[i], vx, vy, vz, lx, ly, lz)
        f0, f1, f2, f3, f4, f5 = _momentum(w.mass[i], w.moment[i], w.inertia[i],
                                           w.A[i, 0], w.A[i, 1], w.A[i, 2], w.A[i, 3], w.A[i, 4], w.A[i, 5])
        x, y, z = cross(vx, vy, vz, hx, hy, hz)
        tx, ty, tz = cross(lx, ly, lz, kx, ky, kz)
        w.F[i, 0], w.F[i, 1], w.F[i, 2] = f0 + x + tx, f1 + y + ty, f2 + z + tz
        x, y, z = cross(vx, vy, vz, kx, ky, kz)
        w.F[i, 3], w.F[i, 4], w.F[i, 5] = f3 + x, f4 + y, f5 + z


@part
def _turn_inertia(tree: Tree, i: int, R: Array, w: Work) -> None:
    """R I_com R' moved to the root's origin (Huygens-Steiner), with first moment and mass."""
    cx, cy, cz = turned(R, tree.com[i, 0], tree.com[i, 1], tree.com[i, 2])
    cx, cy, cz = cx + w.p[i, 0], cy + w.p[i, 1], cz + w.p[i, 2]
    xx, yy, zz = tree.inertia[i, 0], tree.inertia[i, 1], tree.inertia[i, 2]
    xy, xz, yz = tree.inertia[i, 3], tree.inertia[i, 4], tree.inertia[i, 5]
    a0, a1, a2 = turned(R, xx, xy, xz)
    b0, b1, b2 = turned(R, xy, yy, yz)
    c0, c1, c2 = turned(R, xz, yz, zz)
    m = tree.mass[i]
    mx, my, mz = m * cx, m * cy, m * cz
    w.mass[i] = m
    w.moment[i, 0], w.moment[i, 1], w.moment[i, 2] = mx, my, mz
    w.inertia[i, 0] = a0 * R[0, 0] + b0 * R[0, 1] + c0 * R[0, 2] + my * cy + mz * cz
    w.inertia[i, 1] = a1 * R[1, 0] + b1 * R[1, 1] + c1 * R[1, 2] + mx * cx + mz * cz
    w.inertia[i, 2] = a2 * R[2, 0] + b2 * R[2, 1] + c2 * R[2, 2] + mx * cx + my * cy
    w.inertia[i, 3] = a0 * R[1, 0] + b0 * R[1, 1] + c0 * R[1, 2] - mx * cy
    w.inertia[i, 4] = a0 * R[2, 0] + b0 * R[2, 1] + c0 * R[2, 2] - mx * cz
    w.inertia[i, 5] = a1 * R[2, 0] + b1 * R[2, 1] + c1 * R[2, 2] - my * cz


@part
def _momentum(m: float, first: Array, I: Array, wx: float, wy: float, wz: float, vx: float, vy: float, vz: float
              ) -> tuple[float, float, float, float, float, float]:
    """Spatial inertia (mass, first moment, inertia about the point) times a motion vector."""
    mx, my, mz = first[0], first[1], first[2]
    return (I[0] * wx + I[3] * wy + I[4] * wz + my * vz - mz * vy,
            I[3] * wx + I[1] * wy + I[5] * wz + mz * vx - mx * vz,
            I[4] * wx + I[5] * wy + I[2] * wz + mx * vy - my * vx,
            m * vx - (my * wz - mz * wy), m * vy - (mz * wx - mx * wz), m * vz - (mx * wy - my * wx))


@part
def gather(tree: Tree, state: State, dt: float, w: Work) -> None:
    """Mass matrix M + dt D with reflected inertia, lower part; adds the negative of gyroscopic forces and
    gravity, and joints' damping and springs, to w.force."""
    n = tree.parent.shape[0]
    o = 6 if tree.free else 0
    i = int(n)
    while i > 0:
        i -= 1
        k = o + i
        bias = 0.0
        for j in range(6):
            bias += w.S[k, j] * w.F[i, j]
        w.force[k] += -bias - tree.damping[i] * state.v[k] - tree.stiffness[i] * (state.q[i] - tree.rest[i])
        f0, f1, f2, f3, f4, f5 = _momentum(w.mass[i], w.moment[i], w.inertia[i],
                                           w.S[k, 0], w.S[k, 1], w.S[k, 2], w.S[k, 3], w.S[k, 4], w.S[k, 5])
        for t in range(tree.depth[k] + 1):
            j = tree.above[k, t]
            w.M[k, t] = (w.S[j, 0] * f0 + w.S[j, 1] * f1 + w.S[j, 2] * f2 + w.S[j, 3] * f3 + w.S[j, 4] * f4 + w.S[j, 5] * f5)
        w.M[k, tree.depth[k]] += tree.armature[i] + dt * tree.damping[i]
        if tree.carrier[i] < n or tree.free:
            _add_body(i, tree.carrier[i], w)
    if tree.free:
        _gather_base(tree, n, w)


@part
def _add_body(i: int, a: int, w: Work) -> None:
    """Hands what body i weighs, and the force it takes, to the body a that carries it."""
    w.mass[a] += w.mass[i]
    for j in range(3):
        w.moment[a, j] += w.moment[i, j]
    for j in range(6):
        w.inertia[a, j] += w.inertia[i, j]
        w.F[a, j] += w.F[i, j]


@part
def _gather_base(tree: Tree, n: int, w: Work) -> None:
    """Rows of M and forces of the six velocities of a free base."""
    for k in range(6):
        w.force[k] -= w.F[n, k]
    for k in range(3):
        w.force[3 + k] += tree.pull[k]
    m, mx, my, mz = w.mass[n], w.moment[n, 0], w.moment[n, 1], w.moment[n, 2]
    w.M[0, 0], w.M[1, 0], w.M[1, 1] = w.inertia[n, 0], w.inertia[n, 3], w.inertia[n, 1]
    w.M[2, 0], w.M[2, 1], w.M[2, 2] = w.inertia[n, 4], w.inertia[n, 5], w.inertia[n, 2]
    w.M[3, 0], w.M[3, 1], w.M[3, 2] = 0.0, mz, -my
    w.M[4, 0], w.M[4, 1], w.M[4, 2] = -mz, 0.0, mx
    w.M[5, 0], w.M[5, 1], w.M[5, 2] = my, -mx, 0.0
    w.M[3, 3], w.M[4, 3], w.M[4, 4] = m, 0.0, m
    w.M[5, 3], w.M[5, 4], w.M[5, 5] = 0.0, 0.0, m


@part
def factor(depth: Numbers, above: Numbers, H: Array) -> None:
    """H = L' L in place (Featherstone 2008, table 6.3). depth, above: as in `Tree`, or `Tree.number` and `Tree.every`."""
    for k in range(depth.shape[0] - 1, -1, -1):
        d = math.sqrt(H[k, depth[k]])
        H[k, depth[k]] = d
        inverse = 1.0 / d
        for t in range(depth[k]):
            H[k, t] *= inverse
        for t in range(depth[k]):
            c = H[k, t]
            for u in range(t + 1):
                H[above[k, t], u] -= c * H[k, u]


@part
def solve_factored(depth: Numbers, above: Numbers, H: Array, x: Array) -> None:
    """x := (L' L)^-1 x."""
    n = depth.shape[0]
    for i in range(n - 1, -1, -1):
        x[i] /= H[i, depth[i]]
        for t in range(depth[i]):
            x[above[i, t]] -= H[i, t] * x[i]
    for i in range(n):
        s = x[i]
        for t in range(depth[i] - 1, -1, -1):
            s -= H[i, t] * x[above[i, t]]
        x[i] = s / H[i, depth[i]]


@part
def copy_matrix(tree: Tree, M: Array, H: Array) -> None:
    """H := M."""
    for i in range(tree.depth.shape[0]):
        for t in range(tree.depth[i] + 1):
            H[i, t] = M[i, t]


@part
def times_matrix(tree: Tree, M: Array, x: Array, y: Array) -> None:
    """y := M x of the symmetric matrix whose lower part M holds along the paths."""
    n = tree.depth.shape[0]
    for i in range(n):
        y[i] = 0.0
    for i in range(n):
        y[i] += M[i, tree.depth[i]] * x[i]
        for t in range(tree.depth[i] - 1, -1, -1):
            j = tree.above[i, t]
            y[i] += M[i, t] * x[j]
            y[j] += M[i, t] * x[i]
