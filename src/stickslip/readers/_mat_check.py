"""Check that the bytes of a MAT file (versions 5 to 7.2) follow the format before SciPy reads them.

SciPy's reader is compiled and trusts the file: an invalid type ends the whole process with a segmentation fault. Here
every tag is compared with The MathWorks, "MAT-File Format", chapter 1: the type exists, the bytes are in the file, and
their number matches the dimensions.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from struct import unpack_from

HEADER = 128
INT8, UINT8, INT32, UINT32, MATRIX, COMPRESSED, UTF8 = 1, 2, 5, 6, 14, 15, 16
BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
"""Bytes of a number, by the type of the data element."""
TEXT = {1: 1, 2: 1, 3: 2, 4: 2, 16: 1, 17: 2, 18: 4}
CELL, STRUCT, OBJECT, CHAR, SPARSE, FUNCTION, OPAQUE = 1, 2, 3, 4, 5, 16, 17
NUMERIC = range(6, 16)
MAX_DIMENSIONS = 32
MAX_DEPTH = 100
STEP = 2**24
"""Bytes that are decompressed at a time."""


class Damaged(ValueError):
    """A violation of the format in the file."""


@dataclass(frozen=True)
class _Element:
    """A data element: its type, start and end of its bytes, start of the next one."""

    kind: int
    start: int
    end: int
    following: int


@dataclass(frozen=True)
class _Bytes:
    """The bytes and their order ("<" or ">")."""

    data: memoryview
    order: str
    numbers: list[int]
    """Count of numbers in all arrays checked so far."""

    def element(self, at: int, end: int, padded: bool = True) -> _Element:
        """Return the data element at a position before `end`."""
        if at + 8 > end:
            raise Damaged(f"a data element is cut off at byte {at}")
        first, count = unpack_from(f"{self.order}II", self.data, at)
        if small := first >> 16:
            if small > 4:
                raise Damaged(f"the data element at byte {at} says {small} bytes, of 4 at most")
            return _Element(first & 0xFFFF, at + 4, at + 4 + small, at + 8)
        start = at + 8
        if count > end - start:
            raise Damaged(f"the data element at byte {at} says {count} bytes, of which {end - start} exist")
        following = start + count + (-count % 8 if padded else 0)
        return _Element(first, start, start + count, min(following, end))

    def of(self, kinds: tuple[int, ...], at: int, end: int) -> _Element:
        """Return the data element at a position, of one of these types."""
        element = self.element(at, end)
        if element.kind not in kinds:
            raise Damaged(f"the data element at byte {at} has type {element.kind}, which cannot be there")
        return element


def check(content: bytes, insist_on_values: Callable[[int], None] = lambda _: None) -> int:
    """Compare a file of version 5 to 7.2 with its format. Returns the count of variables.

    Parameters
    ----------
    content : bytes
    insist_on_values : callable
        Refuses a count of numbers that is too large; called during decompression, and with the total count of numbers.

    Raises
    ------
    Damaged
        Names the violation and its position.
    """
    if len(content) < HEADER:
        raise Damaged("it ends within its header")
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None:
        raise Damaged("its header does not tell the order of bytes")
    variables, numbers = 0, [0]
    file = _Bytes(memoryview(content), order, numbers)
    at = HEADER
    while at < len(content):
        element = file.element(at, len(content), padded=False)
        if element.kind == COMPRESSED:
            data = _inflated(content[element.start : element.end], at, insist_on_values)
            inner = _Bytes(memoryview(data), order, numbers)
            _matrix(inner, inner.of((MATRIX,), 0, len(inner.data)), 0)
        elif element.kind == MATRIX:
            _matrix(file, element, 0)
        else:
            raise Damaged(f"the variable at byte {at} has type {element.kind}, which cannot be there")
        at = element.end
        variables += 1
        insist_on_values(numbers[0])
    return variables


def _inflated(packed: bytes, at: int, insist_on_values: Callable[[int], None]) -> bytearray:
    """Decompress a variable, in steps whose size is checked."""
    engine = zlib.decompressobj()
    out = bytearray()
    try:
        while not engine.eof and packed:
            out += engine.decompress(packed, STEP)
            packed = engine.unconsumed_tail
            insist_on_values(len(out) // 8)
        if not engine.eof:
            raise zlib.error("it is cut off")
        return out
    except zlib.error as error:
        raise Damaged(f"the variable at byte {at} cannot be decompressed ({error})") from None


def _matrix(file: _Bytes, matrix: _Element, depth: int) -> None:
    """Check an array of any class; recursive for cells and structures."""
    at, end = matrix.start, matrix.end
    if at == end:  # MATLAB's empty array
        return
    if depth > MAX_DEPTH:
        raise Damaged(f"arrays are nested deeper than {MAX_DEPTH} levels")
    flags = file.of((UINT32,), at, end)
    if flags.end - flags.start != 8:
        raise Damaged(f"the array at byte {at} has no flags")
    (word,) = unpack_from(f"{file.order}I", file.data, flags.start)
    kind, complex_ = word & 0xFF, bool(word & 0x800)
    if kind == OPAQUE:
        _opaque(file, flags.following, end, depth)
        return
    dimensions = file.of((INT32, UINT32), flags.following, end)
    count = _count(file, dimensions)
    name = file.of((INT8, UTF8), dimensions.following, end)
    at = name.following
    if kind == CELL:
        _arrays(file, at, end, count, depth)
    elif kind in (STRUCT, OBJECT):
        _structure(file, at, end, kind, count, depth)
    elif kind == CHAR:
        _numbers(file, at, end, TEXT, None)
    elif kind == SPARSE:
        for _ in range(2):  # row indices, then starts of columns
            at = _numbers(file, at, end, BYTES, None)
        for _ in range(1 + complex_):  # MATLAB 7 labels the bytes of logical values as doubles here
            at = file.of(tuple(BYTES), at, end).following
    elif kind in NUMERIC:
        file.numbers[0] += count
        for _ in range(1 + complex_):
            at = _numbers(file, at, end, BYTES, count)
    elif kind == FUNCTION:
        _arrays(file, at, end, 1, depth)
    else:
        raise Damaged(f"the array at byte {matrix.start} has class {kind}, which does not exist")


def _count(file: _Bytes, dimensions: _Element) -> int:
    """Return the number of elements from the dimensions."""
    length = dimensions.end - dimensions.start
    number = length // 4
    if length % 4 or not 1 <= number <= MAX_DIMENSIONS:
        raise Damaged(f"the array at byte {dimensions.start} has {number} dimensions")
    sizes = unpack_from(f"{file.order}{number}i", file.data, dimensions.start)
    if min(sizes) < 0:
        raise Damaged(f"the array at byte {dimensions.start} has a negative dimension")
    return math.prod(sizes)


def _numbers(file: _Bytes, at: int, end: int, types: dict[int, int], count: int | None) -> int:
    """Check an element with a given count of numbers; return the start of the next one."""
    element = file.of(tuple(types), at, end)
    width, length = types[element.kind], element.end - element.start
    if length % width or (count is not None and length // width != count):
        raise Damaged(f"the data at byte {at} hold {length} bytes; the array's dimensions say otherwise")
    return element.following


def _arrays(file: _Bytes, at: int, end: int, count: int, depth: int) -> int:
    if count > (end - at) // 8:
        raise Damaged(f"the array at byte {at} says that it holds {count} others, and has no room for them")
    for _ in range(count):
        matrix = file.of((MATRIX,), at, end)
        _matrix(file, matrix, depth + 1)
        at = matrix.following
    return at


def _structure(file: _Bytes, at: int, end: int, kind: int, count: int, depth: int) -> None:
    if kind == OBJECT:
        at = file.of((INT8, UTF8), at, end).following
    width = file.of((INT32,), at, end)
    if width.end - width.start != 4:
        raise Damaged(f"the structure at byte {at} does not say how long its names are")
    (length,) = unpack_from(f"{file.order}i", file.data, width.start)
    names = file.of((INT8,), width.following, end)
    text = bytes(file.data[names.start : names.end])
    if length < 1 or len(text) % length:
        raise Damaged(f"the structure at byte {at} has names of {length} bytes in {len(text)}")
    if any(0 not in text[i : i + length] for i in range(0, len(text), length)):
        raise Damaged(f"the structure at byte {at} has a name without an end")
    _arrays(file, names.following, end, count * (len(text) // length), depth)


def _opaque(file: _Bytes, at: int, end: int, depth: int) -> None:
    """Check an object of a class: three names, then an array."""
    for _ in range(3):
        at = file.of((INT8, UTF8), at, end).following
    _arrays(file, at, end, 1, depth)
