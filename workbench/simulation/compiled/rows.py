"""The algebra of `tree` for one robot, several entries of a row at once.

A velocity and one on its way to the root have the same velocities above them in the same columns, so that rows are subtracted from
each other whole. Each number is computed by the operations of `tree` in their order: results are the same to the last bit. Rows of
different limbs depend on each other by the base's alone; in turns, the processor need not wait for a limb's roots and quotients.
"""

from __future__ import annotations

import math

from workbench.simulation.compiled.arrays import Array, Tree
from workbench.simulation.compiled.kernel import part
from workbench.simulation.compiled.lanes.number import LANES, put_stretch, stretch


@part
def copy_rows(tree: Tree, M: Array, H: Array) -> None:
    """H := M."""
    for i in range(tree.depth.shape[0]):
        for t in range(0, tree.depth[i] + 1, LANES):
            put_stretch(H, i, t, stretch(M, i, t))


@part
def factor_rows(tree: Tree, H: Array, pivot: Array) -> None:
    """H = L' L in place, but for the diagonal of L, which goes to pivot (nv,): a processor waits long for a row of which a single
    entry has just been written."""
    base = 6 if tree.free else 0
    s = tree.limbs.shape[0]
    while s > 0:
        s -= 1
        k = tree.limbs[s]
        _eliminate(tree, H, pivot, k, tree.depth[k], base)
    if tree.free:
        _hand_to_base(H)
        k = 6
        while k > 0:
            k -= 1
            _eliminate(tree, H, pivot, k, k, 0)


@part
def _eliminate(tree: Tree, H: Array, pivot: Array, k: int, d: int, least: int) -> None:
    """Finishes row k, whose diagonal is in column d, and subtracts it from the rows above from column `least` on."""
    diagonal = math.sqrt(H[k, d])
    pivot[k] = diagonal
    inverse = 1.0 / diagonal
    for u in range(0, d, LANES):
        put_stretch(H, k, u, stretch(H, k, u) * inverse)
    for u in range(0, d, LANES):
        row = stretch(H, k, u)
        for t in range(max(u, least), d):
            i = tree.above[k, t]
            put_stretch(H, i, u, stretch(H, i, u) - H[k, t] * row)


@part
def _hand_to_base(H: Array) -> None:
    """Subtracts all other rows, which are finished, from the base's six."""
    a, b, c = stretch(H, 0, 0), stretch(H, 1, 0), stretch(H, 2, 0)
    d, e, f = stretch(H, 3, 0), stretch(H, 4, 0), stretch(H, 5, 0)
    k = H.shape[0]
    while k > 6:
        k -= 1
        row = stretch(H, k, 0)
        a -= H[k, 0] * row
        b -= H[k, 1] * row
        c -= H[k, 2] * row
        d -= H[k, 3] * row
        e -= H[k, 4] * row
        f -= H[k, 5] * row
    put_stretch(H, 0, 0, a)
    put_stretch(H, 1, 0, b)
    put_stretch(H, 2, 0, c)
    put_stretch(H, 3, 0, d)
    put_stretch(H, 4, 0, e)
    put_stretch(H, 5, 0, f)


@part
def solve_rows(tree: Tree, H: Array, pivot: Array, x: Array) -> None:
    """x := (L' L)^-1 x."""
    base = 6 if tree.free else 0
    s = tree.limbs.shape[0]
    while s > 0:
        s -= 1
        i = tree.limbs[s]
        v = x[i] / pivot[i]
        x[i] = v
        for t in range(base, tree.depth[i]):
            x[tree.above[i, t]] -= H[i, t] * v
    if tree.free:
        _solve_base(H, pivot, x)
    for s in range(tree.limbs.shape[0]):
        i = tree.limbs[s]
        v = x[i]
        t = int(tree.depth[i])
        while t > 0:
            t -= 1
            v -= H[i, t] * x[tree.above[i, t]]
        x[i] = v / pivot[i]


@part
def _solve_base(H: Array, pivot: Array, x: Array) -> None:
    a, b, c, d, e, f = x[0], x[1], x[2], x[3], x[4], x[5]
    i = x.shape[0]
    while i > 6:
        i -= 1
        v = x[i]
        a -= H[i, 0] * v
        b -= H[i, 1] * v
        c -= H[i, 2] * v
        d -= H[i, 3] * v
        e -= H[i, 4] * v
        f -= H[i, 5] * v
    x[0], x[1], x[2], x[3], x[4], x[5] = a, b, c, d, e, f
    for i in range(5, -1, -1):
        x[i] /= pivot[i]
        for t in range(i):
            x[t] -= H[i, t] * x[i]
    for i in range(6):
        v = x[i]
        for t in range(i - 1, -1, -1):
            v -= H[i, t] * x[t]
        x[i] = v / pivot[i]


@part
def times_rows(tree: Tree, M: Array, x: Array, y: Array) -> None:
    """y := M x of the symmetric matrix of whose lower part M holds the rows."""
    base = 6 if tree.free else 0
    for i in range(tree.depth.shape[0]):
        total = 0.0 + M[i, tree.depth[i]] * x[i]
        t = int(tree.depth[i])
        while t > 0:
            t -= 1
            total += M[i, t] * x[tree.above[i, t]]
        y[i] = total
    if tree.free:
        _add_base(M, x, y)
    for i in range(base, tree.depth.shape[0]):
        v = x[i]
        for t in range(base, tree.depth[i]):
            y[tree.above[i, t]] += M[i, t] * v


@part
def _add_base(M: Array, x: Array, y: Array) -> None:
    for i in range(6):
        for t in range(i):
            y[t] += M[i, t] * x[i]
    a, b, c, d, e, f = y[0], y[1], y[2], y[3], y[4], y[5]
    for i in range(6, x.shape[0]):
        v = x[i]
        a += M[i, 0] * v
        b += M[i, 1] * v
        c += M[i, 2] * v
        d += M[i, 3] * v
        e += M[i, 4] * v
        f += M[i, 5] * v
    y[0], y[1], y[2], y[3], y[4], y[5] = a, b, c, d, e, f
