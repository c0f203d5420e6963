"""Pictures within the page: files of the folder as data, checked, and made smaller where large."""

import base64
import io
import struct
from dataclasses import dataclass
from pathlib import Path

from asmjax.errors import UseError, file_errors, require
from asmjax.report.page.folder import Results
from asmjax.report.page.markup import Markup, joined, tag

MOST_BYTES = 1_200_000
"""A larger picture is embedded in a smaller size."""

_SHRUNK = 1400
"""Width in pixels of such a picture."""

_MOST_PIXELS = 80_000_000
"""Of a picture: a file of a few kB can claim any size."""

_PNG, _GIF = b"\x89PNG\r\n\x1a\n", b"GIF8"


@dataclass(frozen=True)
class Picture:
    """An image file: its bytes, of that kind, and its size in pixels."""

    kind: str
    content: bytes
    width: int
    height: int
    shrunk: bool = False

    def image(self, alt: str, **attributes: str | bool) -> Markup:
        """The `img` element; `alt` is what it shows, for those who do not see it."""
        data = base64.b64encode(self.content).decode("ascii")
        return tag(
            "img",
            src=f"data:image/{self.kind};base64,{data}",
            alt=alt,
            width=self.width,
            height=self.height,
            **attributes,
        )


def read_picture(path: Path) -> Picture:
    """A PNG or GIF file, a PNG above `MOST_BYTES` in a smaller size.

    Raises:
        UseError: it cannot be read, or is not whole.
    """
    remedy = "run the command again that wrote it, or delete it"
    with file_errors(f"'{path}' cannot be read", remedy):
        content = path.read_bytes()
    if content.startswith(_GIF) and content.endswith(b";") and len(content) > 10:
        return Picture("gif", content, *struct.unpack("<HH", content[6:10]))
    whole = content.startswith(_PNG) and content[-8:-4] == b"IEND" and len(content) > 45
    require(whole, f"'{path}' is no whole PNG or GIF file; {remedy}.")
    width, height = struct.unpack(">II", content[16:24])
    require(
        0 < width * height <= _MOST_PIXELS,
        f"'{path}' has {width} x {height} pixels; allowed are 1 to {_MOST_PIXELS:,}; {remedy}.",
    )
    if len(content) <= MOST_BYTES:
        return Picture("png", content, width, height)
    try:
        return _shrunk(content)
    except (OSError, ValueError, SyntaxError) as problem:
        raise UseError(f"'{path}' is damaged ({problem}); {remedy}.") from problem


def _shrunk(content: bytes) -> Picture:
    # Pillow is what matplotlib itself writes pictures with.
    from PIL import Image

    with Image.open(io.BytesIO(content)) as image:
        scale = min(1.0, _SHRUNK / image.width)
        size = max(1, round(scale * image.width)), max(1, round(scale * image.height))
        small = image.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    # 256 colours: a third of the bytes, and drawings lose nothing that one sees.
    file = io.BytesIO()
    small.quantize(256).save(file, "PNG")
    return Picture("png", file.getvalue(), *size, shrunk=True)


def figure(results: Results, name: str, caption: str, alt: str) -> Markup | None:
    """A picture of the folder with words below it; None where the folder has none of that name.

    Raises:
        UseError: as `read_picture`.
    """
    path = results.file(name)
    if path is None:
        return None
    picture = read_picture(path)
    small = f" Smaller than in {name}." if picture.shrunk else ""
    return tag("figure", picture.image(alt), tag("figcaption", f"{caption}{small}"))


def figures(results: Results, wanted: dict[str, tuple[str, str]]) -> Markup:
    """Pictures by file name, each with caption and `alt`; a line names those that are not there.

    Raises:
        UseError: as `read_picture`.
    """
    drawn = {name: figure(results, name, *words) for name, words in wanted.items()}
    missing = [name for name, item in drawn.items() if item is None]
    note = f"Not in the folder: {', '.join(missing)}." if missing else None
    return joined([*drawn.values(), tag("p", note, class_="note") if note else None])
