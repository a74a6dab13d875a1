"""The algebra of `tree` for one robot, several entries of a row at once.

A velocity and one on its way to the root have the same velocities above them in the same columns, so that rows are subtracted
from each other whole. Each number is computed by the operations of `tree` in their order: results are the same to the last bit.
Rows of limbs depend on each other only where they join: in turns, the processor need not wait for the roots and quotients of one.
"""

from __future__ import annotations

import math

from workbench.simulation.compiled.arrays import Array, Tree
from workbench.simulation.compiled.kernel import part
from workbench.simulation.compiled.number import LANES, Wide, lane, put_stretch, stretch


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
    s = len(tree.limbs)
    while s > 0:
        s -= 1
        k = tree.limbs[s]
        _scale(H, pivot, k, tree.depth[k])
        _subtract(tree, H, k, tree.inner[k], tree.depth[k])
    s = len(tree.joined)
    while s > 0:
        s -= 1
        k = tree.joined[s]
        if tree.forks[k]:
            _scale(H, pivot, k, tree.depth[k])
        _subtract(tree, H, k, base, tree.inner[k])
    if tree.free:
        _factor_base(H, pivot)


@part
def _scale(H: Array, pivot: Array, k: int, d: int) -> None:
    """Row k, whose diagonal is in column d, over its root."""
    pivot[k] = math.sqrt(H[k, d])
    inverse = 1.0 / pivot[k]
    for u in range(0, d, LANES):
        put_stretch(H, k, u, stretch(H, k, u) * inverse)


@part
def _subtract(tree: Tree, H: Array, k: int, begin: int, end: int) -> None:
    """Row k from those of the velocities on its way in these columns."""
    for u in range(0, end, LANES):
        row = stretch(H, k, u)
        for t in range(max(u, begin), end):
            i = tree.above[k, t]
            put_stretch(H, i, u, stretch(H, i, u) - H[k, t] * row)


@part
def _factor_base(H: Array, pivot: Array) -> None:
    """Subtracts all other rows, which are finished, from the base's six, and finishes those, in registers."""
    a, b, c = stretch(H, 0, 0), stretch(H, 1, 0), stretch(H, 2, 0)
    d, e, f = stretch(H, 3, 0), stretch(H, 4, 0), stretch(H, 5, 0)
    k = len(H)
    while k > 6:
        k -= 1
        row = stretch(H, k, 0)
        a -= H[k, 0] * row
        b -= H[k, 1] * row
        c -= H[k, 2] * row
        d -= H[k, 3] * row
        e -= H[k, 4] * row
        f -= H[k, 5] * row
    f = _finish(H, pivot, 5, f)
    e -= lane(f, 4) * f
    d -= lane(f, 3) * f
    c -= lane(f, 2) * f
    b -= lane(f, 1) * f
    a -= lane(f, 0) * f
    e = _finish(H, pivot, 4, e)
    d -= lane(e, 3) * e
    c -= lane(e, 2) * e
    b -= lane(e, 1) * e
    a -= lane(e, 0) * e
    d = _finish(H, pivot, 3, d)
    c -= lane(d, 2) * d
    b -= lane(d, 1) * d
    a -= lane(d, 0) * d
    c = _finish(H, pivot, 2, c)
    b -= lane(c, 1) * c
    a -= lane(c, 0) * c
    b = _finish(H, pivot, 1, b)
    a -= lane(b, 0) * b
    _finish(H, pivot, 0, a)  # as a whole: of one lane alone, product and difference would be rounded each


@part
def _finish(H: Array, pivot: Array, k: int, row: Wide) -> Wide:
    """The base's row k, over the root of its diagonal."""
    pivot[k] = math.sqrt(lane(row, k))
    row = row * (1.0 / pivot[k])
    put_stretch(H, k, 0, row)
    return row


@part
def solve_rows(tree: Tree, H: Array, pivot: Array, x: Array) -> None:
    """x := (L' L)^-1 x."""
    base = 6 if tree.free else 0
    s = len(tree.limbs)
    while s > 0:
        s -= 1
        k = tree.limbs[s]
        v = x[k] / pivot[k]
        x[k] = v
        for t in range(tree.inner[k], tree.depth[k]):
            x[tree.above[k, t]] -= H[k, t] * v
    s = len(tree.joined)
    while s > 0:
        s -= 1
        k = tree.joined[s]
        if tree.forks[k]:
            x[k] /= pivot[k]
        v = x[k]
        for t in range(base, tree.inner[k]):
            x[tree.above[k, t]] -= H[k, t] * v
    if tree.free:
        _solve_base(H, pivot, x)
        a, b, c, d, e, f = x[0], x[1], x[2], x[3], x[4], x[5]
    else:
        a = b = c = d = e = f = 0.0
    for s in range(tree.order.shape[0]):
        i = tree.order[s]
        v = x[i]
        t = int(tree.depth[i])
        while t > base:
            t -= 1
            v -= H[i, t] * x[tree.above[i, t]]
        if tree.free:
            v -= H[i, 5] * f
            v -= H[i, 4] * e
            v -= H[i, 3] * d
            v -= H[i, 2] * c
            v -= H[i, 1] * b
            v -= H[i, 0] * a
        x[i] = v / pivot[i]


@part
def _solve_base(H: Array, pivot: Array, x: Array) -> None:
    a, b, c, d, e, f = x[0], x[1], x[2], x[3], x[4], x[5]
    i = len(x)
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
    if tree.free:
        _times_base(M, x, y)
    for i in range(base, tree.depth.shape[0]):
        v, t = x[i], int(tree.depth[i])
        total = 0.0 + M[i, t] * v
        while t > base:
            t -= 1
            j = tree.above[i, t]
            total += M[i, t] * x[j]
            y[j] += M[i, t] * v
        if tree.free:
            total += M[i, 5] * x[5]
            total += M[i, 4] * x[4]
            total += M[i, 3] * x[3]
            total += M[i, 2] * x[2]
            total += M[i, 1] * x[1]
            total += M[i, 0] * x[0]
        y[i] = total


@part
def _times_base(M: Array, x: Array, y: Array) -> None:
    """y of a free base."""
    for i in range(6):
        y[i] = 0.0 + M[i, i] * x[i]
        for t in range(i - 1, -1, -1):
            y[i] += M[i, t] * x[t]
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
