"""Seeded mutations of scene files: bytes, lines and numbers changed, moved, doubled or left out."""

import random
import re

NASTY_NUMBERS = (
    b"-1", b"0", b"3", b"255", b"65536", b"2147483647", b"-2147483648", b"4294967295",
    b"4294967296", b"18446744073709551616", b"1e38", b"1e39", b"-1e-45", b"1e400", b"nan", b"inf",
    b"-inf", b"0x10", b"1.5", b"9" * 40,
)  # fmt: skip

NASTY_WORDS = (
    b"../", b"/etc/passwd", b"/dev/zero", b"plugins/", b"$x", b"\\$", b"&x;", b"&#0;", b"&#x2e;",
    b"<path value='/'/>", b"<!DOCTYPE x>", b"<!--", b"-->", b"<![CDATA[", b"]]>", b"<?x?>", b"\0",
    b"\xff", b"\xc0\xaf", b"\r\n", b'"', b"<", b">", b"/>", b"</scene>", b"element face 9\n",
    b"property list uchar int x\n", b"end_header\n", b"v 0 0 0\n", b"f 1 1 1\n", b"%s%n",
    b"<include filename='scene.xml'/>", b"<default name='x' value='$x$x'/>", b"x" * 999,
)  # fmt: skip

NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")


def mutated(content: bytes, chance: random.Random) -> bytes:
    """`content` after one to four changes."""
    for _ in range(chance.choice((1, 1, 1, 2, 4))):
        content = chance.choice(CHANGES)(content, chance)
    return content


def _span(content: bytes, chance: random.Random, longest: int = 64) -> tuple[int, int]:
    start = chance.randrange(len(content) + 1)
    return start, min(len(content), start + chance.randint(1, longest))


def change_byte(content: bytes, chance: random.Random) -> bytes:
    start, _ = _span(content, chance)
    return content[:start] + bytes([chance.randrange(256)]) + content[start + 1 :]


def change_bit(content: bytes, chance: random.Random) -> bytes:
    if not content:
        return content
    place = chance.randrange(len(content))
    flipped = content[place] ^ (1 << chance.randrange(8))
    return content[:place] + bytes([flipped]) + content[place + 1 :]


def leave_out(content: bytes, chance: random.Random) -> bytes:
    start, end = _span(content, chance)
    return content[:start] + content[end:]


def double(content: bytes, chance: random.Random) -> bytes:
    start, end = _span(content, chance, 400)
    return content[:end] + content[start:end] * chance.choice((1, 1, 2, 50)) + content[end:]


def cut_off(content: bytes, chance: random.Random) -> bytes:
    return content[: chance.randrange(len(content) + 1)]


def insert(content: bytes, chance: random.Random) -> bytes:
    start, _ = _span(content, chance)
    return content[:start] + chance.choice(NASTY_WORDS) + content[start:]


def change_number(content: bytes, chance: random.Random) -> bytes:
    found = list(NUMBER.finditer(content))
    if not found:
        return content
    place = chance.choice(found)
    return content[: place.start()] + chance.choice(NASTY_NUMBERS) + content[place.end() :]


def move_line(content: bytes, chance: random.Random) -> bytes:
    lines = content.splitlines(keepends=True)
    if len(lines) < 2:
        return content
    line = lines.pop(chance.randrange(len(lines)))
    lines.insert(chance.randrange(len(lines) + 1), line)
    return b"".join(lines)


def change_line(content: bytes, chance: random.Random) -> bytes:
    lines = content.splitlines(keepends=True)
    if not lines:
        return content
    place = chance.randrange(len(lines))
    lines[place : place + 1] = [lines[place]] * chance.choice((0, 0, 2, 3))
    return b"".join(lines)


CHANGES = (
    change_byte, change_bit, leave_out, double, cut_off, insert, change_number, change_number,
    change_number, move_line, change_line,
)  # fmt: skip
"""Numbers most often: counts, indices and sizes are what loaders stumble over."""
