"""What a Mitsuba scene file would make the renderer do, read before native code sees a byte of it.

A scene file can name native libraries to run (plugins), files to read, and numbers to allocate by,
and Mitsuba's own reader is recursive. This scan reads the file and all it includes with the XML
parser of the standard library, substitutes `$parameters` as Mitsuba does, and refuses what is not
on its lists. Only tags, attributes and the names of files are looked at; what meshes hold is for
`asmjax.scene.mesh_files`, what the renderer makes of it all for `asmjax.render.untrusted`.
"""

import math
import stat
from collections.abc import Set
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, NoReturn
from xml.parsers import expat

from asmjax.errors import UseError
from asmjax.scene.file_names import TRUST, Folder, Names, has_control, shown
from asmjax.scene.spec import MAX_SIDE

MOST_DEPTH = 64
"""Nested elements, those around an include among them. Mitsuba's reader crashes at some 10,000."""

MOST_INCLUDE_DEPTH = 14
"""Includes within each other; Mitsuba stops there too."""

MOST_INCLUDES = 1000
"""Includes in all."""

MOST_ELEMENTS = 200_000
"""Elements in all, those of a file that is included twice counted twice."""

MOST_BYTES = 64 * 2**20
"""Bytes of XML in all, counted as elements are, with what `$parameters` stand for."""

MOST_PARAMETERS = 256
"""Defaults of `$parameters`; each is looked for in every attribute with a `$`."""

MOST_VALUE = 2**14
"""Characters of an attribute, its `$parameters` filled in."""

MOST_FILLING = 2**28
"""Characters in which `$parameters` are looked for, those of an attribute once for each parameter
that there is, with `FOR_EACH` more."""

FOR_EACH = 64
"""Characters that can be looked through in the time that a look takes besides."""

LONGEST_MISSPELT = 64
"""Characters of a plugin for which the nearest known one is looked for."""

OBJECTS = frozenset(
    "bsdf emitter field film integrator medium phase rfilter sampler scene sensor shape spectrum "
    "texture volume".split()
)
"""Elements that are made by a plugin, which `type` names."""

VALUES = frozenset(
    "alias boolean default float include integer lookat matrix point ref rgb rotate scale spectrum "
    "string transform translate vector".split()
)
"""Elements that hold a value."""

ENCODINGS = (None, "utf-8", "us-ascii")
"""What an XML declaration may name: both readers must see the same characters."""


class Range(NamedTuple):
    """Numbers from `least` to `most`; without the ends where it is `open`."""

    least: float
    most: float
    open: bool = False

    def __contains__(self, number: object) -> bool:
        if not isinstance(number, int | float):
            return False
        if self.open:
            return self.least < number < self.most
        return self.least <= number <= self.most

    def __str__(self) -> str:
        ends = ", both ends left out" if self.open else ""
        return f"{self.least:g} to {self.most:g}{ends}"


SIDE, OFFSET = Range(1, MAX_SIDE), Range(0, MAX_SIDE)

RANGES = {
    ("film", "width"): SIDE,
    ("film", "height"): SIDE,
    ("film", "crop_width"): SIDE,
    ("film", "crop_height"): SIDE,
    ("film", "crop_offset_x"): OFFSET,
    ("film", "crop_offset_y"): OFFSET,
    ("sensor", "fov"): Range(0, 180, open=True),
}
"""(element, name of its value): what the value may be. Pixels; degrees."""


class Reference(NamedTuple):
    """A file that a scene names.

    Attributes:
        path: resolved, a regular file inside the scene's folder.
        kind: the plugin that reads it, such as ply, or the element that names it.
    """

    path: Path
    kind: str


@dataclass(frozen=True)
class SceneFiles:
    """All files that a scene consists of.

    Attributes:
        folder: the scene's own; everything is inside it.
        documents: the XML files, the scene's own first.
        references: what else is read, each once.
    """

    folder: Folder
    documents: tuple[Path, ...]
    references: tuple[Reference, ...]

    def bytes(self) -> int:
        """Bytes of all of them on disk."""
        paths = {*self.documents, *(reference.path for reference in self.references)}
        return sum(path.stat().st_size for path in paths)


def scan(path: Path, plugins: Set[str]) -> SceneFiles:
    """The files of the scene at `path`, all of it checked.

    Args:
        plugins: names that `type` may have; those that come with the renderer.

    Raises:
        UseError: anything that is not allowed, with file, line, what is allowed, and what to do.
            Nothing outside the scene's folder was opened.
    """
    return _Scan(path, plugins).run()


class _Open(NamedTuple):
    """A file that is being read, the folders in which Mitsuba looks before the scene's own, and how
    many elements were around it when it began."""

    path: Path
    beside: frozenset[Path]
    parser: expat.XMLParserType
    depth: int


class _Scan:
    """One scan; the lists grow as it goes."""

    def __init__(self, path: Path, plugins: Set[str]):
        self._path, self._plugins = path, plugins
        self._folder = Folder(path.parent)
        self._names = Names(self._folder)
        self._sound: set[Path] = set()  # folders in which nothing shadows
        self._documents: dict[Path, None] = {}
        self._references: dict[Reference, None] = {}
        self._parameters: list[tuple[str, str]] = []  # longest name first, as they are filled in
        self._defined: set[str] = set()
        self._elements = self._bytes = self._includes = self._filling = 0
        self._stack: list[tuple[str, str]] = []  # tag and plugin of the elements around
        self._open: list[_Open] = []

    def run(self) -> SceneFiles:
        if has_control(self._path.name):
            raise UseError(
                f"scene file {shown(self._path.name)} has a line break or another control "
                "character in its name; give it another name."
            )
        real = self._folder.real_path(str(self._path.absolute()))
        if real is None:
            raise UseError(
                f"scene file {shown(self._path.name)} is a link out of its folder; give the path "
                "of the file itself."
            )
        self._document(real, frozenset({real.parent, self._folder.path}))
        return SceneFiles(self._folder, tuple(self._documents), tuple(self._references))

    def _document(self, path: Path, folders: frozenset[Path]) -> None:
        """Scan an XML file, inside the folder, at the place where it is included; Mitsuba then
        looks for files in one of `folders` too."""
        for folder in folders - self._sound:
            Folder(folder).check_nothing_shadows()
        self._sound |= folders
        parser = expat.ParserCreate("UTF-8")
        if len(self._open) > MOST_INCLUDE_DEPTH:
            self._refuse(
                f"includes files deeper than {MOST_INCLUDE_DEPTH} within each other, or in a "
                "circle; write them out."
            )
        self._includes += 1
        if self._includes > MOST_INCLUDES + 1:
            self._refuse(f"includes more than {MOST_INCLUDES} files in all; write them out.")
        around = self._open[-1].beside if self._open else frozenset()
        beside = (around | folders) - {self._folder.path}
        self._open.append(_Open(path, beside, parser, len(self._stack)))
        content = self._read(path)
        self._documents[path] = None
        parser.StartElementHandler = self._element
        parser.EndElementHandler = lambda tag: self._stack.pop()
        parser.StartDoctypeDeclHandler = lambda *_: self._refuse(
            "has a DOCTYPE; allowed are elements and attributes; take it out."
        )
        parser.XmlDeclHandler = self._declaration
        try:
            parser.Parse(content, True)
        except expat.ExpatError as problem:
            self._refuse(
                f"is not XML that Mitsuba can load ({expat.ErrorString(problem.code)}); mend the "
                "scene."
            )
        self._open.pop()

    def _read(self, path: Path) -> bytes:
        try:
            found = path.stat()
            if not stat.S_ISREG(found.st_mode):
                self._refuse("is no regular file; give the path of a Mitsuba .xml file.")
            size = found.st_size
            self._spend(size)
            content = path.read_bytes()
        except OSError as problem:
            self._refuse(f"cannot be read ({problem.strerror}); make it readable.")
        if len(content) > size:
            self._spend(len(content) - size)
        try:
            content.decode("utf-8")
        except UnicodeDecodeError:
            self._refuse("is not UTF-8 text; save it as UTF-8.")
        return content

    def _declaration(self, version: str, encoding: str | None, standalone: int) -> None:
        if (encoding and encoding.lower()) not in ENCODINGS:
            self._refuse(f"is encoded as {shown(encoding or '')}; save it as UTF-8.")

    def _element(self, tag: str, raw: dict[str, str]) -> None:
        self._elements += 1
        if self._elements > MOST_ELEMENTS:
            self._refuse(f"has more than {MOST_ELEMENTS:,} elements in all; merge shapes, {TRUST}.")
        if len(self._stack) >= MOST_DEPTH:
            self._refuse(f"nests elements deeper than {MOST_DEPTH}; flatten it.")
        if tag == "path":
            self._refuse(
                "has a <path> element, which makes Mitsuba look for files and native code "
                f"elsewhere; put the files into the scene's folder and take it out, {TRUST}."
            )
        if tag not in OBJECTS and tag not in VALUES:
            self._refuse(
                f"has an element <{shown(tag)}>; allowed are those of Mitsuba 3, such as <shape>; "
                "mend the scene."
            )
        outermost = len(self._stack) == self._open[-1].depth
        if outermost and tag != "scene" and (len(self._open) == 1 or tag not in OBJECTS):
            self._refuse(f"begins with <{tag}>, so has no shapes; begin with <scene>.")
        given = {name: self._filled(value) for name, value in raw.items()}
        plugin = given.get("type", "")
        if "type" in given:
            self._check_plugin(tag, plugin)
        self._stack.append((tag, plugin))
        if tag == "default":
            self._define(given.get("name", ""), given.get("value", ""))
        if "filename" in given:
            self._file(given["filename"], tag)
        if tag in VALUES and "value" in given:
            self._check_value(tag, given.get("name", ""), given["value"])

    def _check_plugin(self, tag: str, plugin: str) -> None:
        if plugin in self._plugins or (tag == plugin == "scene"):
            return
        near = []
        if len(plugin) <= LONGEST_MISSPELT:
            import difflib

            near = difflib.get_close_matches(plugin, self._plugins, n=1)
        hint = f" Did you mean '{near[0]}'?" if near else ""
        self._refuse(
            f"has the unknown plugin type {shown(plugin)}; allowed are those that come with "
            f"Mitsuba, such as sphere.{hint} Mend the scene."
        )

    def _check_value(self, tag: str, name: str, value: str) -> None:
        around, plugin = self._stack[-2] if len(self._stack) > 1 else ("", "")
        if tag == "string":
            if self._folder.is_named_by(name, value):
                self._file(value, plugin or around)
            return
        allowed = RANGES.get((around, name))
        if allowed is None:
            return
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if number not in allowed:
            self._refuse(
                f"{around} {name} is {shown(value)}; allowed is {allowed}; mend the scene."
            )

    def _file(self, name: str, kind: str) -> None:
        """A file named `name` by what `kind` says; an included one is scanned."""
        try:
            found = self._names.file(name, self._open[-1].beside)
        except UseError as problem:
            self._refuse(str(problem))
        if kind == "include":
            self._document(found.path, found.folders)
        else:
            self._references[Reference(found.path, kind)] = None

    def _define(self, name: str, value: str) -> None:
        """A default of a parameter: the first one counts."""
        key = f"${name}"
        if key in self._defined:
            return
        if len(self._parameters) == MOST_PARAMETERS:
            self._refuse(f"has more than {MOST_PARAMETERS} parameters; write some of them out.")
        if "\\" in value:
            self._refuse("has a backslash in a <default>; write the value where it is used.")
        if "\\" in name or "$" in name:
            self._refuse(f"has a <default> of name {shown(name)}; take out signs that mean more.")
        place = next(
            (k for k, (known, _) in enumerate(self._parameters) if len(key) > len(known)),
            len(self._parameters),
        )
        self._parameters.insert(place, (key, value))
        self._defined.add(key)

    def _filled(self, value: str) -> str:
        """`value` with its `$parameters` filled in as `substitute_parameters` of Mitsuba's
        `src/core/parser.cpp` does: one after the other, where no backslash stands before."""
        if len(value) > MOST_VALUE:
            self._refuse_long()
        if "$" not in value:
            return value
        before = len(value)
        # No text of XML has a NUL, and what is filled in has no backslash.
        value = value.replace("\\$", "\0")
        for key, filling in self._parameters:
            self._filling += len(value) + FOR_EACH
            if key not in value:
                continue
            # Counted first: what is filled in may multiply what was.
            if len(value) + value.count(key) * (len(filling) - len(key)) > MOST_VALUE:
                self._refuse_long()
            value = value.replace(key, filling)
        if self._filling > MOST_FILLING:
            self._refuse(
                f"looks for {len(self._parameters)} parameters in too many attributes with a $: "
                f"{MOST_FILLING:,} characters in all; write some of them out."
            )
        self._spend(max(len(value) - before, 0))
        if "$" in value:
            name = value[value.index("$") :].replace("\0", "$")
            self._refuse(f"uses the parameter {shown(name)}, which has no <default>; add one.")
        return value.replace("\0", "$")

    def _refuse_long(self) -> NoReturn:
        self._refuse(
            f"has an attribute of more than {MOST_VALUE} characters, its $parameters filled in; "
            "write it shorter, or a spectrum into an .spd file."
        )

    def _spend(self, count: int) -> None:
        self._bytes += count
        if self._bytes > MOST_BYTES:
            self._refuse(
                f"has more than {MOST_BYTES // 2**20} MiB of XML in all; keep triangles in .ply "
                "files."
            )

    def _refuse(self, what: str) -> NoReturn:
        # A refusal before the first file is open cannot happen: `run` opens it first.
        path, _, parser, _ = self._open[-1]
        raise UseError(
            f"scene file {shown(self._folder.relative(path))}, line {parser.CurrentLineNumber}: "
            f"{what}"
        )
