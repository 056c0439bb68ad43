"""Records of arrays that kernels take whole.

Handing an array over to a compiled function costs time, and a state has more than twenty. So a kernel takes one array
of their addresses and shapes, `state.handle`, and begins with `state = state_at(handle)`; from there it reads
`state.network.battery[b]` as Python does. With NUMBA_DISABLE_JIT=1 the handle is the record itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, Self

import numpy as np
from llvmlite import ir
from numba import carray, config, types
from numba.extending import intrinsic, models, overload, overload_attribute, register_model

RECORD = np.record if config.DISABLE_JIT else np.void  # np.record's fields read as attributes in Python, too


def record(members: list) -> np.dtype:
    """A structured type whose fields kernels read as attributes."""
    return np.dtype((RECORD, np.dtype(members, align=True)))


def array(dtype, *axes: str | int) -> Any:
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

    def parts(self) -> tuple:
        """The fields, in order."""
        return tuple(getattr(self, item.name) for item in fields(self))

    def map(self, change) -> Self:
        """The same record with every array changed."""
        return type(self)(*(each.map(change) if isinstance(each, Arrays) else change(each) for each in self.parts()))

    def copy(self) -> Self:
        """A deep copy: no array is shared."""
        return self.map(np.copy)

    def leaves(self) -> list[tuple[str, np.ndarray]]:
        """(name, array) of all, such as ("network.battery", ...)."""
        found: list[tuple[str, np.ndarray]] = []
        for item, each in zip(fields(self), self.parts()):
            if isinstance(each, Arrays):
                found += [(f"{item.name}.{name}", leaf) for name, leaf in each.leaves()]
            else:
                found.append((item.name, each))
        return found

    @cached_property
    def handle(self):
        """What kernels take: (n,) int64, address and shape of each array. The arrays must outlive the call."""
        if config.DISABLE_JIT:
            return self
        words: list[int] = []
        for (name, leaf), (dtype, dimensions) in zip(self.leaves(), _leaf_types(type(self))):
            if leaf.dtype != dtype or leaf.ndim != dimensions or not leaf.flags.c_contiguous:
                raise TypeError(
                    f"{type(self).__name__}.{name}: {leaf.dtype} of {leaf.ndim} dimensions, contiguous:"
                    f" {leaf.flags.c_contiguous}; must be contiguous {dtype} of {dimensions}"
                )
            words += leaf.__array_interface__["data"][0], *leaf.shape
        return np.array(words, np.int64)

    def __reduce__(self):
        return type(self), self.parts()  # an address holds in one process, for one record

    def __getattr__(self, name: str) -> np.ndarray:
        """A field of the structured array `row`: `belief.mean` is `belief.row["mean"]`."""
        if name != "row" and not name.startswith("__"):
            row = self.__dict__.get("row")
            if row is not None and name in row.dtype.names:
                return row[name]
        raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")


def _leaf_types(cls: type[Arrays]) -> list[tuple[np.dtype, int]]:
    found: list[tuple[np.dtype, int]] = []
    for item in fields(cls):
        about = item.metadata
        found += _leaf_types(about["part"]) if "part" in about else [(about["dtype"], len(about["axes"]))]
    return found


def _words(cls: type[Arrays]) -> int:
    """How long a handle is."""
    return sum(1 + dimensions for _, dimensions in _leaf_types(cls))


class _ByAddress(types.Type):
    """A record in compiled code: the address of its words in the handle. A class of its own for each record."""


@register_model(_ByAddress)
class _AddressModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, ir.IntType(64))


@intrinsic
def _pointer(context, address):
    def generate(context, builder, signature, arguments):
        return builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())

    return types.voidptr(types.int64), generate


@intrinsic
def _address_of(context, record):
    def generate(context, builder, signature, arguments):
        return arguments[0]

    return types.int64(record), generate


@intrinsic
def _word(context, record, place):
    """Number `place` of a record's words."""

    def generate(context, builder, signature, arguments):
        words = builder.inttoptr(arguments[0], ir.IntType(64).as_pointer())
        return builder.load(builder.gep(words, [arguments[1]]))

    return types.int64(record, types.int64), generate


_known: dict[type[Arrays], Any] = {}  # the compiled type of each class


def _compiled_type(cls: type[Arrays]) -> Any:
    if cls not in _known:
        own = type(f"{cls.__name__}ByAddress", (_ByAddress,), {})
        register_model(own)(_AddressModel)
        _known[cls] = own(cls.__qualname__)
        place = 0
        for item in fields(cls):
            about = item.metadata
            if "part" in about:
                _add_part(own, item.name, _compiled_type(about["part"]), place)
                place += _words(about["part"])
            else:
                _add_array(own, item.name, about["dtype"], len(about["axes"]), place)
                place += 1 + len(about["axes"])
    return _known[cls]


def _add_part(own, name: str, kind, place: int) -> None:
    cast, offset = _cast_to(kind), 8 * place

    @overload_attribute(own, name, inline="never")
    def attribute(record):
        return lambda record: cast(_address_of(record) + offset)


def _add_array(own, name: str, dtype: np.dtype, dimensions: int, place: int) -> None:
    a, b, c, d = range(place + 1, place + 5)
    ways = {
        1: lambda record: carray(_pointer(_word(record, place)), (_word(record, a),), dtype),
        2: lambda record: carray(_pointer(_word(record, place)), (_word(record, a), _word(record, b)), dtype),
        3: lambda record: carray(
            _pointer(_word(record, place)), (_word(record, a), _word(record, b), _word(record, c)), dtype
        ),
        4: lambda record: carray(
            _pointer(_word(record, place)),
            (_word(record, a), _word(record, b), _word(record, c), _word(record, d)),
            dtype,
        ),
    }
    overload_attribute(own, name, jit_options={"_nrt": True})(lambda record: ways[dimensions])


def _cast_to(kind):
    @intrinsic
    def cast(context, address):
        def generate(context, builder, signature, arguments):
            return arguments[0]

        return kind(types.int64), generate

    return cast


def opener(cls: type[Arrays]):
    """A function for kernels: the record of a handle.

    Args:
        cls: of the record.
    """
    cast = _cast_to(_compiled_type(cls))

    def record_at(handle):
        return handle

    @overload(record_at)
    def _(handle):
        return lambda handle: cast(handle.ctypes.data)

    record_at.__qualname__ = f"{cls.__name__}_at"
    record_at.__kernel_layout__ = repr(_leaf_types(cls))
    return record_at
