"""Whether a mesh file is what it says: counts that fit its size, indices in range, finite vertices.

Mitsuba 3.9 allocates by a header's counts, takes a face index slightly out of range as it is, and
crashes at one far out of range. So PLY and OBJ files are read here first: binary
ones at the speed of NumPy, text at about two microseconds a triangle. Both are looked at in pieces,
so that a larger file takes no more memory.
As in Mitsuba, faces of a PLY file are triangles, each list three numbers long.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from asmjax.errors import UseError, file_errors, require
from asmjax.scene.file_names import shown

LONGEST_HEADER = 2**16
"""Bytes of a PLY header."""

MOST_PROPERTIES = 256
"""Properties of a PLY element."""

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "long": "i8", "int64": "i8", "ulong": "u8", "uint64": "u8",
    "half": "f2", "float16": "f2", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
"""PLY's names of number types, and NumPy's."""

ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
"""PLY's formats, and NumPy's sign for their byte order."""

LISTS = ("vertex_indices", "vertex_index")
"""Names of the list that holds a face's corners."""

MOST_TEXT = 2**28
"""Bytes of the largest file of text that is read here; a larger one would take too much time, and
is left to the child process that loads scenes first (`asmjax.render.untrusted`)."""

PIECE = 2**18
"""Bytes of text that are read at once; no line of an OBJ file and no word may have more."""

SLICE = 2**18
"""Binary records that are looked at at once."""

ROWS = 2**14
"""Records of text that are looked at at once."""

SERIALIZED_MAGIC = b"\x1c\x04"
"""First bytes of Mitsuba's own format."""


def check_mesh_file(path: Path, kind: str, name: str) -> None:
    """Refuse a mesh file that a loader might stumble over.

    Args:
        kind: the shape plugin that would read it; only ply, obj and serialized are known here.
        name: of the file in messages.

    Raises:
        UseError: one line with what is wrong and where.
    """
    checker = CHECKERS.get(kind)
    if checker is None:
        return
    try:
        with file_errors("cannot be read", "make it readable"):
            require(path.stat().st_size > 0, "is empty; export it again.")
            checker(path)
    except UseError as problem:
        raise UseError(f"mesh file {shown(name)} {problem}") from problem


@dataclass
class _Element:
    """One kind of records of a PLY file: `columns` are (name, type) as NumPy has them, those of
    a list its length and three numbers."""

    name: str
    count: int
    columns: list[tuple[str, str]] = field(default_factory=list)
    lists: list[str] = field(default_factory=list)


def _check_ply(path: Path) -> None:
    order, elements, start = _ply_header(path)
    by_name = {element.name: element for element in elements}
    require(len(by_name) == len(elements), "names an element twice; export it again.")
    for name in ("vertex", "face"):
        require(
            name in by_name and by_name[name].count > 0,
            f"has no element {name}, or none of it; a mesh needs vertices and faces.",
        )
    for element in elements:
        _record_type(element, order)
    columns = [name for name, _ in by_name["vertex"].columns]
    for axis in "xyz":
        require(axis in columns, f"has no vertex property {axis}; export it again.")
    lists = [name for name in LISTS if name in by_name["face"].lists]
    require(bool(lists), f"has no face list {LISTS[0]}; export it again.")
    require(len(lists) == 1, f"has the face lists {' and '.join(lists)}; export one of them.")
    read = _binary_records if order else _ascii_records
    for element, records in read(path, order, elements, start):
        for name in element.lists:
            require(
                bool((records[f"{name}.count"] == 3).all()),
                f"has {element.name} lists {shown(name)} that are not three long; allowed are "
                "triangles; triangulate it.",
            )
        if element.name == "vertex":
            for axis in "xyz":
                _check_finite(records[axis])
        if element.name == "face":
            for corner in range(3):
                _check_indices(records[f"{lists[0]}.{corner}"], 0, by_name["vertex"].count)


def _ply_header(path: Path) -> tuple[str, list[_Element], int]:
    """The byte order ("" for text), the elements, and where the header ends."""
    with path.open("rb") as file:
        head = file.read(LONGEST_HEADER)
    end = re.search(rb"^[ \t]*end_header[ \t]*\r?\n", head, re.MULTILINE)
    require(head[:3] == b"ply" and end is not None, "has no PLY header; export it again.")
    assert end is not None
    order, elements = None, []
    require(
        bool(re.fullmatch(rb"[\t\n\r -~]*", head[: end.start()])),
        "has a PLY header with characters that are not plain text; export it again.",
    )
    for line in head[: end.start()].decode("ascii").split("\n")[1:]:
        words = line.split()
        try:
            match words:
                case [] | ["comment" | "obj_info", *_]:
                    continue
                case ["format", form, "1.0"] if order is None:
                    order = ORDERS[form]
                case ["element", name, count] if count.isdecimal() and len(count) < 19:
                    elements.append(_Element(name, int(count)))
                case ["property", "list", length, kind, name]:
                    _add_list(elements[-1], TYPES[length], TYPES[kind], name)
                case ["property", kind, name]:
                    elements[-1].columns.append((name, TYPES[kind]))
                case _:
                    raise ValueError(line)
        except UseError:
            raise
        except (KeyError, IndexError, ValueError) as problem:
            raise UseError(
                f"has the header line {shown(line)}, which is none of PLY 1.0; export it again."
            ) from problem
        require(
            not elements or len(elements[-1].columns) <= MOST_PROPERTIES,
            f"has more than {MOST_PROPERTIES} properties; export fewer.",
        )
    require(order is not None, "has no line that says its format; export it again.")
    return str(order), elements, end.end()


def _add_list(element: _Element, length: str, kind: str, name: str) -> None:
    require(
        length[0] != "f" and (name not in LISTS or kind[0] != "f"),
        f"has a list {shown(name)} that is not of whole numbers; export it again.",
    )
    element.lists.append(name)
    element.columns.append((f"{name}.count", length))
    element.columns.extend((f"{name}.{k}", kind) for k in range(3))


def _check_fits(element: _Element, size: int, room: int) -> None:
    require(
        element.count * size <= room,
        f"says that it has {element.count:,} of element {shown(element.name)}, but there is room "
        f"for {room // max(size, 1):,} at most; it is cut off, or export it again.",
    )


_Records = Iterator[tuple[_Element, np.ndarray]]
"""Records of a file in its order, by element, in one piece or in several."""


def _binary_records(path: Path, order: str, elements: list[_Element], start: int) -> _Records:
    content = np.memmap(path, np.uint8, "r")
    # All counts first: what is mapped beyond the end of a file cannot be read.
    pieces = []
    for element in elements:
        dtype = _record_type(element, order)
        _check_fits(element, dtype.itemsize, len(content) - start)
        if element.count * dtype.itemsize > 0:
            pieces.append((element, np.ndarray(element.count, dtype, content.data, start)))
        start += element.count * dtype.itemsize
    for element, records in pieces:
        for first in range(0, len(records), SLICE):
            yield element, records[first : first + SLICE]


def _ascii_records(path: Path, order: str, elements: list[_Element], start: int) -> _Records:
    size = path.stat().st_size
    if size > MOST_TEXT:
        return
    words = _words(path, start)
    for element in elements:
        dtype = _record_type(element, order, "f8")
        width, seen = len(element.columns), 0
        while seen < element.count and width > 0:
            rows = min(ROWS, element.count - seen)
            numbers = _numbers(list(islice(words, rows * width)))
            if len(numbers) < rows * width:
                _check_fits(element, width, seen * width + len(numbers))
            yield element, numbers.view(dtype)
            seen += rows


def _words(path: Path, start: int) -> Iterator[bytes]:
    """The words of a file from byte `start` on."""
    with path.open("rb") as file:
        file.seek(start)
        rest = b""
        while piece := file.read(PIECE):
            words = (rest + piece).split()
            # The last word may go on in the next piece.
            rest = b"" if piece[-1:].isspace() or not words else words.pop()
            require(len(rest) <= PIECE, "has a word that does not end; export it again.")
            yield from words
        if rest:
            yield rest


def _record_type(element: _Element, order: str, kind: str | None = None) -> np.dtype:
    try:
        return np.dtype([(name, order + (kind or own)) for name, own in element.columns])
    except ValueError as problem:
        raise UseError(
            f"has two properties of one name in element {shown(element.name)}; export it again."
        ) from problem


def _check_obj(path: Path) -> None:
    if path.stat().st_size > MOST_TEXT:
        return
    count, extremes = 0, []
    for piece in _whole_lines(path):
        vertices = [line.split(None, 3)[:3] for line in _lines(piece, b"v")]
        faces = [re.sub(rb"/[^ \t]*", b"", line).split() for line in _lines(piece, b"f")]
        require(
            all(len(vertex) == 3 for vertex in vertices),
            "has a vertex of fewer than three numbers; export it again.",
        )
        require(
            all(len(face) >= 3 for face in faces),
            "has a face of fewer than three corners; export it again.",
        )
        _check_finite(_numbers([number for vertex in vertices for number in vertex]))
        count += len(vertices)
        if faces:
            corners = _numbers([number for face in faces for number in face])
            # How many vertices there are is known in the end.
            with np.errstate(invalid="ignore"):
                broken = corners[corners % 1 != 0][:1]
            extremes.extend([corners.min(), corners.max(), *broken])
    require(count > 0 and bool(extremes), "has no vertices or no faces; export it again.")
    _check_indices(np.array(extremes), 1, count + 1)


def _whole_lines(path: Path) -> Iterator[bytes]:
    """A file in pieces that end where a line ends."""
    with path.open("rb") as file:
        rest = b""
        while piece := file.read(PIECE):
            lines, end, rest = (rest + piece).rpartition(b"\n")
            require(
                len(rest) <= PIECE,
                f"has a line of more than {PIECE:,} characters; export it again.",
            )
            if end:
                yield lines
        yield rest


def _lines(content: bytes, word: bytes) -> list[bytes]:
    """What follows `word` on the lines that begin with it."""
    return re.findall(rb"^[ \t]*" + word + rb"[ \t]+([^\r\n#]*)", content, re.MULTILINE)


def _check_serialized(path: Path) -> None:
    """Its head and its table of offsets; what is compressed in between is for a child process."""
    content = np.memmap(path, np.uint8, "r")
    size = len(content)
    require(
        size > 8 and content[:2].tobytes() == SERIALIZED_MAGIC and content[2] in (3, 4),
        "is not in Mitsuba's serialized format; export it again.",
    )
    meshes = int(np.ndarray(1, "<u4", content.data, size - 4)[0])
    offset = 4 if content[2] == 3 else 8
    require(
        0 < meshes <= (size - 8) // offset,
        f"says that it has {meshes:,} meshes, which do not fit; it is cut off, or export it again.",
    )


def _numbers(words: list[bytes]) -> np.ndarray:
    try:
        return np.fromiter(map(float, words), np.float64, len(words))
    except ValueError as problem:
        raise UseError("has a word where a number belongs; mend it.") from problem


def _check_finite(coordinates: np.ndarray) -> None:
    with np.errstate(over="ignore"):
        finite = np.isfinite(coordinates.astype(np.float32, copy=False))
    require(
        bool(finite.all()),
        "has a vertex coordinate that is no finite number of single precision; mend it.",
    )


def _check_indices(indices: np.ndarray, least: int, end: int) -> None:
    """`indices` are `least` to `end` - 1, and whole."""
    low, high = indices.min(), indices.max()
    inside = bool(low >= least and high < end)  # of NaN neither is true
    worst = low if low < least else high
    require(
        inside and (indices.dtype.kind in "iu" or bool((indices % 1 == 0).all())),
        f"has a face with vertex {worst:.12g}; allowed are whole numbers from {least} to "
        f"{end - 1}; mend it.",
    )


CHECKERS: dict[str, Callable[[Path], None]] = {
    "ply": _check_ply,
    "obj": _check_obj,
    "serialized": _check_serialized,
}
