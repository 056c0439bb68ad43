"""Records of arrays that kernels take whole.

Handing an array over to a compiled function costs time, and a state has more than twenty. So a kernel takes one array
of their addresses and shapes, `state.handle`, and begins with `state = state_at(handle)`; from there it reads
`state.network.battery[b]` as Python does. With NUMBA_DISABLE_JIT=1 the handle is the record itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cache, cached_property
from math import prod
from operator import attrgetter
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from llvmlite.ir import Constant
from numba import config, from_dtype, types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, models, overload, register_model


class _Row(np.record):  # type: ignore[misc]  # final in NumPy's stubs alone
    """An element whose fields read as attributes in Python, too, whatever they are called: `row.mean` is a field."""

    def __getattribute__(self, name):
        if not name.startswith("__") and name in (np.void.__getattribute__(self, "dtype").names or ()):
            return self[name]
        return super().__getattribute__(name)


def record(members: list[Any]) -> np.dtype[np.void]:
    """A structured type whose fields kernels read as attributes."""
    made = np.dtype(members, align=True)
    return np.dtype((_Row, made)) if config.DISABLE_JIT else made


def blank(dtype: np.dtype[Any], *shape: int) -> np.ndarray:
    """Zeros of a `record` type: of a few in a quarter of the time that np.zeros takes."""
    return np.ndarray(shape, dtype, bytearray(dtype.itemsize * prod(shape)))


def array(dtype: npt.DTypeLike, *axes: str | int) -> Any:
    """A field of a record of arrays.

    Args:
        dtype: of its elements.
        axes: their names, such as "rows", or fixed lengths.
    """
    return field(metadata={"dtype": np.dtype(dtype), "axes": axes})


def part(kind: type[Arrays]) -> Any:
    """A field that is a record of arrays itself."""
    return field(metadata={"part": kind})


@dataclass(frozen=True, eq=False)
class Arrays:
    """Base: a dataclass whose fields are `array` or `part`. Its arrays are never replaced, only written to."""

    @classmethod
    def zeros(cls, **lengths: int) -> Self:
        """Of the right shapes.

        Args:
            lengths: of the axes by name; what is left out is 0.
        """
        made = []
        for item in fields(cls):
            about = item.metadata
            if "part" in about:
                made.append(about["part"].zeros(**lengths))
            else:
                shape = tuple(lengths.get(axis, 0) if isinstance(axis, str) else axis for axis in about["axes"])
                made.append(np.zeros(shape, about["dtype"]))
        return cls(*made)

    def parts(self) -> tuple[Any, ...]:
        """The fields, in order."""
        return tuple(vars(self)[name] for name in _names(type(self)))

    def map(self, change: Callable[[np.ndarray], np.ndarray]) -> Self:
        """The same record with every array changed."""
        return type(self)(*(each.map(change) if isinstance(each, Arrays) else change(each) for each in self.parts()))

    def copy(self) -> Self:
        """A deep copy: no array is shared."""
        return self.map(np.copy)

    def freeze(self) -> Self:
        """The same record, whose arrays can no longer be written to."""
        for _, leaf in self.leaves():
            leaf.flags.writeable = False
        return self

    def leaves(self) -> list[tuple[str, np.ndarray]]:
        """(name, array) of all, such as ("network.battery", ...)."""
        return [(name, read(self)) for name, _, _, read in _leaves(type(self))]

    @cached_property
    def handle(self) -> Any:
        """What kernels take: (n,) int64, address and shape of each array. The arrays must outlive the call."""
        if config.DISABLE_JIT:
            return self
        words: list[int] = []
        for name, dtype, dimensions, read in _leaves(type(self)):
            leaf = read(self)
            if leaf.dtype != dtype or leaf.ndim != dimensions or not leaf.flags.c_contiguous:
                raise TypeError(
                    f"{type(self).__name__}.{name}: {leaf.dtype} of {leaf.ndim} dimensions, contiguous:"
                    f" {leaf.flags.c_contiguous}; must be contiguous {dtype} of {dimensions}"
                )
            words += leaf.ctypes.data, *leaf.shape
        return np.array(words, np.int64)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self.parts()  # an address holds in one process, for one record

    def __getattr__(self, name: str) -> np.ndarray:
        """A field of the structured array `row`: `belief.mean` is `belief.row["mean"]`."""
        if name != "row" and not name.startswith("__"):
            row = self.__dict__.get("row")
            if row is not None and name in row.dtype.names:
                return row[name]
        raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")


def _names_of(cls: Any) -> tuple[str, ...]:
    return tuple(item.name for item in fields(cls))


def _leaves_of(cls: Any) -> list[tuple[str, np.dtype, int, Callable[[Any], np.ndarray]]]:
    """Name, type of the elements and dimensions of every array, and what reads it."""
    found: list[Any] = []
    for item in fields(cls):
        about = item.metadata
        if "part" in about:
            for name, dtype, dimensions, _ in _leaves(about["part"]):
                path = f"{item.name}.{name}"
                found.append((path, dtype, dimensions, attrgetter(path)))
        else:
            found.append((item.name, about["dtype"], len(about["axes"]), attrgetter(item.name)))
    return found


_names: Any = cache(_names_of)  # Any: mypy takes no class of dataclasses for hashable
_leaves: Any = cache(_leaves_of)


def _layout(cls: type[Arrays]) -> list:
    """Every field with what it holds: kernels read them by their places."""
    found: list = []
    for item in fields(cls):
        about = item.metadata
        found.append((item.name, _layout(about["part"]) if "part" in about else (about["dtype"], len(about["axes"]))))
    return found


def _words(cls: type[Arrays]) -> int:
    """How long a handle is."""
    return sum(1 + dimensions for _, _, dimensions, _ in _leaves(cls))


class _ByAddress(types.Type):
    """A record in compiled code: the address of its words in the handle. A class of its own for each record."""

    places: dict[str, tuple[int, Any]]  # by field: where its words begin, and its compiled type


@register_model(_ByAddress)
class _AddressModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, WORD)


WORD: Any = ir.IntType(64)

_known: dict[type[Arrays], Any] = {}  # the compiled type of each class


def _compiled_type(cls: type[Arrays]) -> Any:
    if cls not in _known:
        own: Any = type(f"{cls.__name__}ByAddress", (_ByAddress,), {"places": {}})
        register_model(own)(_AddressModel)
        place = 0
        for item in fields(cls):
            about = item.metadata
            if "part" in about:
                own.places[item.name] = place, _compiled_type(about["part"])
                place += _words(about["part"])
            else:
                kind = types.Array(from_dtype(about["dtype"]), len(about["axes"]), "C")
                own.places[item.name] = place, kind
                place += 1 + kind.ndim
        _teach(own)
        _known[cls] = own(cls.__qualname__)
    return _known[cls]


def _teach(own: type[_ByAddress]) -> None:
    """What the attributes of a record are, and how they are read."""

    @infer_getattr
    class Attributes(AttributeTemplate):
        key = own

        def generic_resolve(self, kind, name):
            return own.places[name][1] if name in own.places else None

    @lower_getattr_generic(own)
    def read(context, builder, kind, address, name):
        place, of = own.places[name]
        if isinstance(of, _ByAddress):
            return builder.add(address, WORD(8 * place))
        words = builder.inttoptr(address, WORD.as_pointer())
        numbers = [builder.load(builder.gep(words, [WORD(place + k)])) for k in range(1 + of.ndim)]
        return _array_at(context, builder, of, numbers[0], numbers[1:])


def _array_at(context, builder, kind, address, lengths):
    """A C-contiguous array that owns nothing."""
    made = context.make_array(kind)(context, builder)
    itemsize = WORD(context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    steps: list[Any] = []
    stride = itemsize
    for length in reversed(lengths):
        steps.insert(0, stride)
        stride = builder.mul(stride, length, flags=["nsw"])
    size = WORD(1)
    for length in lengths:
        size = builder.mul(size, length, flags=["nsw"])
    made.meminfo, made.parent = Constant(made.meminfo.type, None), Constant(made.parent.type, None)
    made.nitems, made.itemsize = size, itemsize
    made.data = builder.inttoptr(address, made.data.type)
    made.shape, made.strides = cgutils.pack_array(builder, lengths), cgutils.pack_array(builder, steps)
    return made._getvalue()


def opener(cls: type[Arrays]) -> Any:
    """A function for kernels: the record of a handle.

    Args:
        cls: of the record.
    """
    kind = _compiled_type(cls)

    @intrinsic
    def address_of(context, handle):
        def generate(context, builder, signature, arguments):
            words = context.make_array(signature.args[0])(context, builder, arguments[0])
            return builder.ptrtoint(words.data, WORD)

        return kind(handle), generate

    def record_at(handle):
        return handle

    named: Any = record_at

    @overload(record_at)
    def _(handle):
        return lambda handle: address_of(handle)

    named.__qualname__ = f"{cls.__name__}_at"
    named.__kernel_layout__ = repr(_layout(cls))  # counts in stamps
    return named
