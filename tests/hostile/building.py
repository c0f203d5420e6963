"""Parts that hostile scenes are built of, and the harmless scene that each of them differs from."""

import struct
from pathlib import Path

EYE = '<sensor type="perspective"><float name="fov" value="40"/></sensor>'
LAMP = '<emitter type="point"/>'
BALL = '<shape type="sphere"><point name="center" x="0" y="0" z="4"/></shape>'

CORNERS = ((0.0, 0.0, 4.0), (1.0, 0.0, 4.0), (0.0, 1.0, 4.0))
"""Of the one triangle that every mesh here consists of."""


def scene_xml(*parts: str, version: str = "3.0.0") -> str:
    """A whole scene of `parts`, with eye and lamp."""
    return f'<scene version="{version}">\n{EYE}\n{LAMP}\n' + "\n".join(parts) + "\n</scene>\n"


def mesh_xml(name: str, kind: str = "ply") -> str:
    """A shape that is read from a file."""
    return f'<shape type="{kind}"><string name="filename" value="{name}"/></shape>'


def film_xml(name: str, value: str) -> str:
    """A second sensor, whose film has one integer."""
    film = f'<film type="hdrfilm"><integer name="{name}" value="{value}"/></film>'
    return f'<sensor type="perspective">{film}</sensor>'


def fov_xml(value: str) -> str:
    """A second sensor with that field of view."""
    return f'<sensor type="perspective"><float name="fov" value="{value}"/></sensor>'


def text_scene(folder: Path, text: str | bytes) -> Path:
    """`text` as the scene file of `folder`."""
    path = folder / "scene.xml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def parts_scene(folder: Path, *parts: str) -> Path:
    """A scene of eye, lamp and `parts` as the scene file of `folder`."""
    return text_scene(folder, scene_xml(*parts))


def mesh_scene(folder: Path, content: bytes, kind: str = "ply") -> Path:
    """A scene of one mesh file."""
    (folder / f"mesh.{kind}").write_bytes(content)
    return parts_scene(folder, mesh_xml(f"mesh.{kind}", kind))


def ply_header(
    form: str = "binary_little_endian",
    vertices: object = 3,
    faces: object = 1,
    extra: str = "",
    coordinate: str = "float",
    listed: str = "list uchar int vertex_indices",
) -> str:
    """The head of a PLY file; `extra` are lines before the last."""
    axes = "".join(f"property {coordinate} {axis}\n" for axis in "xyz")
    return (
        f"ply\nformat {form} 1.0\nelement vertex {vertices}\n{axes}"
        f"element face {faces}\nproperty {listed}\n{extra}end_header\n"
    )


def ply(
    vertices=CORNERS, faces=((0, 1, 2),), *, order: str = "<", kind: str = "f", **header
) -> bytes:
    """A binary PLY file, its header's counts those of the lists unless `header` says otherwise."""
    form = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    counts = {"vertices": len(vertices), "faces": len(faces)}
    head = ply_header(
        form, **{**counts, "coordinate": {"f": "float", "d": "double"}[kind], **header}
    )
    body = b"".join(struct.pack(f"{order}3{kind}", *vertex) for vertex in vertices)
    for face in faces:
        body += struct.pack(f"{order}B{len(face)}i", len(face), *face)
    return head.encode() + body


def text_ply(vertices: str = "0 0 4\n1 0 4\n0 1 4\n", faces: str = "3 0 1 2\n") -> bytes:
    """A PLY file of text, one record a line."""
    head = ply_header("ascii", vertices.count("\n"), faces.count("\n"))
    return (head + vertices + faces).encode()


def obj(vertices: str = "v 0 0 4\nv 1 0 4\nv 0 1 4\n", faces: str = "f 1 2 3\n") -> bytes:
    """An OBJ file."""
    return (vertices + faces).encode()
