"""Hostile scenes that ask for much work by little: long words, names and lines, many of each."""

from pathlib import Path

from hostile.building import BALL, mesh_xml, obj, parts_scene, ply, text_ply
from hostile.makers import Hostile, include, mesh, parts, shape


def chain_of_links(folder: Path, outside: Path) -> Path:
    """More links, each to the next, than the system or Python follows."""
    for k in range(3000):
        (folder / f"link{k}.ply").symlink_to(f"link{k + 1}.ply")
    return parts_scene(folder, mesh_xml("link0.ply"))


def deep_folder(folder: Path, outside: Path) -> Path:
    """A mesh many folders down, named by a short link."""
    deep = folder / "/".join("a" * 100)
    deep.mkdir(parents=True)
    (deep / "mesh.ply").write_bytes(ply())
    (folder / "short").symlink_to(deep)
    return parts_scene(folder, mesh_xml("short/mesh.ply"))


def many_looks(folder: Path, outside: Path) -> Path:
    """Includes within each other, in folders of their own, where names are looked for first."""
    (folder / "mesh.ply").write_bytes(ply())
    for k in range(9):
        parts = [include(f"sub{k + 1}/x.xml")]
        if k == 8:
            parts = [mesh_xml(f"{number}/../mesh.ply") for number in range(2001)]
        (folder / f"sub{k}").mkdir()
        (folder / f"sub{k}/x.xml").write_text(f'<scene version="3.0.0">{"".join(parts)}</scene>')
    return parts_scene(folder, include("sub0/x.xml"))


NUMBERED = "".join(f'<default name="p{k}" value="1"/>' for k in range(256))

FLOODS = {
    "256 parameters in 60,000 attributes": Hostile(
        parts(
            NUMBERED,
            '<ref id="$p255"/>' * 60_000,
        ),
        "looks for 256 parameters in too many attributes",
    ),
    "256 parameters in 60,000 attributes of one element": Hostile(
        parts(
            NUMBERED,
            "<ref " + " ".join(f'a{k}="$p0"' for k in range(60_000)) + "/>",
        ),
        "looks for 256 parameters in too many attributes",
    ),
    "parameters that mean each other": Hostile(
        parts(
            "".join(f'<default name="p{k:03}" value="\\$p{k + 1:03}"/>' for k in range(255)),
            '<default name="p255" value="1"/>',
            f'<ref id="{"$p000" * 3200}"/>' * 100,
        ),
        "looks for 256 parameters in too many attributes",
    ),
    "value of 20,000 characters": Hostile(
        parts(f'<spectrum value="{"400:1, " * 3000}"/>', BALL), "more than 16384 characters"
    ),
    "plugin of 8 MB": Hostile(parts(shape("s" * 8_000_000)), "more than 16384 characters"),
    "plugin of 16 KB": Hostile(
        parts(shape("s" * 16_000)), "plugin type 's+\\.\\.\\.'.* as sphere. Mend"
    ),
    "file name of 640 KB": Hostile(
        parts(mesh_xml("a/" * 320_000 + "m.ply")), "more than 16384 characters"
    ),
    "file name of 2,000 folders": Hostile(parts(mesh_xml("a/" * 2000 + "m.ply")), "2,000 folders"),
    "3,000 links": Hostile(chain_of_links, "which is outside|not in the scene"),
    "100 folders down": Hostile(deep_folder, "deeper than 64 folders"),
    "2,001 names in 10 folders": Hostile(many_looks, "more than 20,000 files"),
    "endless word": Hostile(mesh(text_ply(vertices="9" * 600_000 + "\n")), "does not end"),
    "an endless line": Hostile(mesh(obj() + b"# " + b"x" * 600_000, "obj"), "line of more than"),
}
