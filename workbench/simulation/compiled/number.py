"""Numbers of LANES robots at once, for kernels: vectors of the processor, an entry (a lane) for each robot, and masks of lanes.
The kernel of one robot takes as many numbers of a matrix's row at once.

Arithmetic, comparisons, abs, sqrt, sin and cos of such numbers are element by element, so that a part of a kernel which does not
branch on numbers compiles for them unchanged. What branches is written with `where`. An operation rounds in a lane as it does
alone, but for sin and cos, which may differ in the last bit.
"""

from __future__ import annotations

import math
import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import lower_builtin, lower_cast
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, models, overload, register_model
from numba.np.arrayobj import populate_array

from workbench.simulation.compiled.arrays import ROW
from workbench.simulation.compiled.kernel import part

LANES = ROW
"""Robots at once: two registers of AVX2, whose operations then overlap, or one of AVX-512. Where vectors are narrower, LLVM takes
more of them; where there are none, it computes one lane after the other, and nothing is gained."""
Wide = Any
Mask = Any
"""For annotations: a number, and a condition, in each lane."""
_WIDE, _MASK = ir.VectorType(ir.DoubleType(), LANES), ir.VectorType(ir.IntType(1), LANES)
_REAL = (types.Float, types.Integer)


class _Wide(types.Type):
    """A number in each lane; float64 and int become one."""

    def __init__(self) -> None:
        super().__init__(name=f"wide{LANES}")

    def can_convert_from(self, typingctx: object, other: object) -> Conversion | None:
        return Conversion.safe if isinstance(other, _REAL) else None

    def unify(self, typingctx: object, other: object) -> _Wide | None:
        return self if isinstance(other, _REAL) else None


class _Lanes(types.Type):
    """Some of the lanes."""

    def __init__(self) -> None:
        super().__init__(name=f"mask{LANES}")


WIDE, MASK = _Wide(), _Lanes()


@register_model(_Wide)
class _WideModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: object, kind: object) -> None:
        super().__init__(manager, kind, _WIDE)


@register_model(_Lanes)
class _MaskModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: object, kind: object) -> None:
        super().__init__(manager, kind, _MASK)


def _everywhere(builder: Any, value: Any, vector: Any) -> Any:
    none = ir.Constant(vector, ir.Undefined)
    first = builder.insert_element(none, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, none, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))


@lower_cast(types.Float, _Wide)
def _of_float(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return _everywhere(builder, context.cast(builder, value, fromty, types.float64), _WIDE)


@lower_cast(types.Integer, _Wide)
def _of_integer(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return _everywhere(builder, context.cast(builder, value, fromty, types.float64), _WIDE)


def _element_by_element(op: Any, of: Any, gives: Any, lowered: Any) -> None:
    """Defines an operator of numbers or masks. of, gives: the type of its operands and of its value."""

    class Template(AbstractTemplate):  # type: ignore[misc]
        def generic(self, args: Any, kws: Any) -> Any:
            fits = of in args and all(a == of or (of == WIDE and isinstance(a, _REAL)) for a in args)
            return signature(gives, *[of] * len(args)) if fits else None

    infer_global(op)(Template)
    count = 1 if op in (operator.neg, operator.invert, abs) else 2
    lower_builtin(op, *[of] * count)(lambda context, builder, sig, args: lowered(builder, *args))


def _called(name: str) -> Any:
    """LLVM's function of that name on all lanes."""
    def call(builder: Any, x: Any) -> Any:
        kind = ir.FunctionType(_WIDE, [_WIDE])
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64"), [x])
    return call


def _define() -> None:
    fused = ("contract",)  # as in all of a kernel: a product and a sum may be one instruction
    for ops, name in (((operator.add, operator.iadd), "fadd"), ((operator.sub, operator.isub), "fsub"),
                      ((operator.mul, operator.imul), "fmul"), ((operator.truediv, operator.itruediv), "fdiv")):
        for op in ops:
            _element_by_element(op, WIDE, WIDE, lambda b, x, y, name=name: getattr(b, name)(x, y, flags=fused))
    for op, sign in ((operator.lt, "<"), (operator.le, "<="), (operator.gt, ">"), (operator.ge, ">=")):
        _element_by_element(op, WIDE, MASK, lambda b, x, y, sign=sign: b.fcmp_ordered(sign, x, y))
    _element_by_element(operator.neg, WIDE, WIDE, lambda b, x: b.fneg(x))
    _element_by_element(abs, WIDE, WIDE, _called("fabs"))
    for ops, name in (((operator.and_, operator.iand), "and_"), ((operator.or_, operator.ior), "or_")):
        for op in ops:
            _element_by_element(op, MASK, MASK, lambda b, x, y, name=name: getattr(b, name)(x, y))
    _element_by_element(operator.invert, MASK, MASK, lambda b, x: b.not_(x))


_define()


@intrinsic
def wide(typing: Any, x: Any) -> Any:
    """The same number in every lane."""
    return WIDE(WIDE), lambda context, builder, sig, args: args[0]


@intrinsic
def where(typing: Any, mask: Any, yes: Any, no: Any) -> Any:
    """yes in the lanes of the mask, no in the others."""
    return WIDE(MASK, WIDE, WIDE), lambda context, builder, sig, args: builder.select(*args)


@intrinsic
def anywhere(typing: Any, mask: Any) -> Any:
    """Whether there is any lane in the mask."""
    def lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        bits = ir.IntType(LANES)
        return builder.icmp_unsigned("!=", builder.bitcast(args[0], bits), ir.Constant(bits, 0))
    return types.boolean(MASK), lowered


@intrinsic
def lane(typing: Any, x: Any, i: Any) -> Any:
    """The number in lane i."""
    return types.float64(WIDE, types.int64), lambda context, builder, sig, args: builder.extract_element(*args)


@intrinsic
def with_lane(typing: Any, x: Any, i: Any, value: Any) -> Any:
    """x, but for another number in lane i."""
    return (WIDE(WIDE, types.int64, types.float64),
            lambda context, builder, sig, args: builder.insert_element(args[0], args[2], args[1]))


@intrinsic
def least(typing: Any, a: Any, b: Any) -> Any:
    """The smaller of two, lane by lane."""
    return WIDE(WIDE, WIDE), lambda c, b, s, args: b.select(b.fcmp_ordered("<", args[1], args[0]), args[1], args[0])


@intrinsic
def most(typing: Any, a: Any, b: Any) -> Any:
    """The larger of two, lane by lane."""
    return WIDE(WIDE, WIDE), lambda c, b, s, args: b.select(b.fcmp_ordered(">", args[1], args[0]), args[1], args[0])


@intrinsic
def _whole(typing: Any, x: Any) -> Any:
    return WIDE(WIDE), lambda context, builder, sig, args: _called("rint")(builder, args[0])


@intrinsic
def _floor(typing: Any, x: Any) -> Any:
    return WIDE(WIDE), lambda context, builder, sig, args: _called("floor")(builder, args[0])


@intrinsic
def _root(typing: Any, x: Any) -> Any:
    return WIDE(WIDE), lambda context, builder, sig, args: _called("sqrt")(builder, args[0])


@intrinsic
def as_wide(typing: Any, array: Any) -> Any:
    """An array (..., LANES) of float64, whose data begin at a multiple of LANES numbers, as an array (...) of wide numbers: the
    same memory."""
    out = types.Array(WIDE, array.ndim - 1, "C")

    def lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        given = context.make_array(sig.args[0])(context, builder, args[0])
        made = context.make_array(out)(context, builder)
        populate_array(made, data=builder.bitcast(given.data, ir.PointerType(_WIDE)),
                       shape=cgutils.unpack_tuple(builder, given.shape)[:-1],
                       strides=cgutils.unpack_tuple(builder, given.strides)[:-1],
                       itemsize=ir.Constant(ir.IntType(64), 8 * LANES), meminfo=None)
        return made._getvalue()
    return out(array), lowered


def _place(context: Any, builder: Any, kind: Any, array: Any, i: Any, t: Any) -> Any:
    """Where entry t of row i of an array is, as that of a wide number."""
    a = context.make_array(kind)(context, builder, array)
    at = builder.add(builder.mul(i, cgutils.unpack_tuple(builder, a.shape)[1]), t)
    return builder.bitcast(builder.gep(a.data, [at]), ir.PointerType(_WIDE))


@intrinsic
def stretch(typing: Any, array: Any, i: Any, t: Any) -> Any:
    """Entries t to t + LANES - 1 of row i of an array (n, m) of float64, C-contiguous, as one wide number."""
    def lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(_place(context, builder, sig.args[0], *args), align=8)
    return WIDE(array, types.int64, types.int64), lowered


@intrinsic
def put_stretch(typing: Any, array: Any, i: Any, t: Any, x: Any) -> Any:
    """Writes these entries."""
    def lowered(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(args[3], _place(context, builder, sig.args[0], *args[:3]), align=8)
        return context.get_dummy_value()
    return types.void(array, types.int64, types.int64, WIDE), lowered


@part
def within(x: Wide, low: Wide, high: Wide) -> Wide:
    """x, but not beyond low and high."""
    return least(most(x, low), high)


@part
def with_sign(size: Wide, of: Wide) -> Wide:
    """A number of this size, not negative, and the sign of another; positive where that is zero."""
    return where(of < 0.0, -size, size)


@part
def exponential(x: Wide) -> Wide:
    """e to the power of x."""
    out = x
    for i in range(LANES):
        out = with_lane(out, i, math.exp(lane(x, i)))
    return out


_PI_2 = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21
"""pi/2 in three parts, of which whole multiples below a million are exact."""
_SIN = (1.58969099521155010221e-10, -2.50507602534068634195e-08, 2.75573137070700676789e-06, -1.98412698298579493134e-04,
        8.33333333332248946124e-03, -1.66666666666666324348e-01)
_COS = (-1.13596475577881948265e-11, 2.08757232129817482790e-09, -2.75573143513906633035e-07, 2.48015872894767294178e-05,
        -1.38888888888741095749e-03, 4.16666666666666019037e-02)
"""Of fdlibm, up to pi/4 (the error is below 2^-57); the highest power first."""


@part
def _sine_and_cosine(x: Wide) -> tuple[Wide, Wide]:
    quarters = _whole(x * (2.0 / math.pi))
    r = ((x - quarters * _PI_2[0]) - quarters * _PI_2[1]) - quarters * _PI_2[2]
    z = r * r
    s = ((((_SIN[0] * z + _SIN[1]) * z + _SIN[2]) * z + _SIN[3]) * z + _SIN[4]) * z + _SIN[5]
    c = ((((_COS[0] * z + _COS[1]) * z + _COS[2]) * z + _COS[3]) * z + _COS[4]) * z + _COS[5]
    s, c = r + r * z * s, 1.0 - (0.5 * z - z * z * c)
    quarter = quarters - 4.0 * _floor(0.25 * quarters)
    odd = (quarter > 0.5) & ((quarter < 1.5) | (quarter > 2.5))
    sine, cosine = where(odd, c, s), where(odd, s, c)
    return where(quarter > 1.5, -sine, sine), where((quarter > 0.5) & (quarter < 2.5), -cosine, cosine)


@overload(math.sin)
def _sin(x):  # type: ignore[no-untyped-def]
    return (lambda x: _sine_and_cosine(x)[0]) if x == WIDE else None


@overload(math.cos)
def _cos(x):  # type: ignore[no-untyped-def]
    return (lambda x: _sine_and_cosine(x)[1]) if x == WIDE else None


@overload(math.sqrt)
def _sqrt(x):  # type: ignore[no-untyped-def]
    return (lambda x: _root(x)) if x == WIDE else None
