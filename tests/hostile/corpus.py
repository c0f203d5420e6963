"""Hostile scenes, made by code: what each is called, how it is made, what its refusal says."""

import struct
import sys
from pathlib import Path

from hostile.building import (
    BALL,
    film_xml,
    fov_xml,
    mesh_xml,
    obj,
    ply,
    ply_header,
    scene_xml,
    text_ply,
)
from hostile.floods import FLOODS
from hostile.makers import (
    Hostile,
    include,
    include_bomb,
    mesh,
    nested,
    parts,
    scene_cannot_be_read,
    scene_is_a_link,
    scene_is_a_link_to_plugins,
    scene_is_a_pipe,
    shape,
    text,
    with_files,
    with_link,
    with_pipe,
)

DOUBLING = '<default name="a0" value="0123456789"/>' + "".join(
    f'<default name="a{k + 1}" value="{f"$a{k}" * 10}"/>' for k in range(12)
)
LAUGHS = '<!DOCTYPE scene [<!ENTITY a0 "ha">' + "".join(
    f'<!ENTITY a{k + 1} "{f"&a{k};" * 10}">' for k in range(9)
)
EMPTY = '<scene version="3.0.0"/>'
TEXTURE = (
    '<bsdf type="diffuse"><texture type="bitmap" name="reflectance">'
    '<string name="filename" value="{}"/></texture></bsdf>'
)

DOCUMENTS = {
    "empty file": Hostile(text(""), "line 1: is not XML"),
    "spaces only": Hostile(text(" \n \n"), "is not XML"),
    "no XML": Hostile(text("a scene with a tree"), "line 1: is not XML"),
    "binary rubbish": Hostile(text(bytes(range(1, 256)) * 9), "not UTF-8"),
    "NUL bytes": Hostile(text(scene_xml(BALL).replace("sphere", "sph\0ere")), "is not XML"),
    "NUL bytes at the end": Hostile(text(scene_xml(BALL) + "\0" * 99), "is not XML"),
    "UTF-16": Hostile(text(scene_xml(BALL).encode("utf-16")), "not UTF-8"),
    "Latin-1": Hostile(text(scene_xml(f"<!-- \xfc -->{BALL}").encode("latin-1")), "not UTF-8"),
    "overlong UTF-8": Hostile(
        text(scene_xml(BALL).encode().replace(b"sphere", b"\xc0\xafsphere")), "not UTF-8"
    ),
    "declared UTF-7": Hostile(
        text('<?xml version="1.0" encoding="utf-7"?>' + scene_xml(BALL)), "encoded as 'utf-7'"
    ),
    "declared UTF-16": Hostile(
        text('<?xml version="1.0" encoding="UTF-16"?>' + scene_xml(BALL)), "encoded as 'UTF-16'"
    ),
    "tag left open": Hostile(text('<scene version="3.0.0"><shape type="sphere">'), "is not XML"),
    "two roots": Hostile(text(scene_xml(BALL) * 2), "is not XML"),
    "attribute twice": Hostile(parts('<shape type="sphere" type="cube"/>'), "duplicate attribute"),
    "undefined entity": Hostile(parts("&secret;" + BALL), "is not XML"),
    "character that is none": Hostile(parts('<shape type="&#0;"/>'), "is not XML"),
    "root is a shape": Hostile(text('<shape version="3.0.0" type="sphere"/>'), "begins with"),
    "root is HTML": Hostile(text("<html><body/></html>"), "has an element"),
    "DOCTYPE": Hostile(text("<!DOCTYPE scene>" + scene_xml(BALL)), "DOCTYPE"),
    "DOCTYPE of a file": Hostile(
        text('<!DOCTYPE scene SYSTEM "/etc/passwd">' + scene_xml(BALL)), "DOCTYPE"
    ),
    "DOCTYPE of a host": Hostile(
        text('<!DOCTYPE scene PUBLIC "x" "http://localhost:9/x.dtd">' + scene_xml(BALL)), "DOCTYPE"
    ),
    "external entity": Hostile(
        text('<!DOCTYPE s [<!ENTITY x SYSTEM "file:///etc/passwd">]>' + scene_xml("&x;")), "DOCTYPE"
    ),
    "parameter entity": Hostile(
        text('<!DOCTYPE s [<!ENTITY % x SYSTEM "/etc/passwd"> %x;]>' + scene_xml()), "DOCTYPE"
    ),
    "a billion laughs": Hostile(text(LAUGHS + "]>" + scene_xml("&a9;")), "DOCTYPE"),
    "a billion parameters": Hostile(parts(DOUBLING, BALL), "more than 16384 characters"),
    "257 parameters": Hostile(
        parts("".join(f'<default name="p{k}" value="1"/>' for k in range(257))), "more than 256"
    ),
    "default of a name with a $": Hostile(
        parts('<default name="a\\$a" value="1"/>', BALL), "of name 'a\\$a'"
    ),
    "default of a name with a backslash": Hostile(
        parts('<default name="a\\" value="1"/>', BALL), "of name 'a"
    ),
    "default with a backslash": Hostile(
        parts('<default name="a" value="\\"/>' + BALL), "backslash in a <default>"
    ),
    "undefined parameter": Hostile(parts(shape("$kind")), "parameter '\\$kind'.*no <default>"),
    "nested 20,000 deep": Hostile(parts(nested(20_000)), "deeper than 64"),
    "nested 64 deep": Hostile(parts(nested(64)), "deeper than 64"),
    "200,001 elements": Hostile(parts('<ref id="x"/>' * 200_001), "more than 200,000 elements"),
    "65 MiB": Hostile(parts(f"<!--{' ' * (65 * 2**20)}-->"), "more than 64 MiB"),
    "unknown element": Hostile(parts("<script/>"), "element <'script'>"),
    "element of a namespace": Hostile(
        parts('<x:path xmlns:x="y" value="."/>'), "element <'x:path'>"
    ),
    "path element": Hostile(parts('<path value="OUTSIDE"/>', BALL), "<path> element"),
    "path element with a dot": Hostile(parts('<path value="."/>', BALL), "<path> element"),
    "path element in a shape": Hostile(
        parts('<shape type="sphere"><path value=".."/></shape>'), "<path> element"
    ),
    "the scene is a link": Hostile(scene_is_a_link, "link out of its folder"),
    "the scene is a FIFO": Hostile(scene_is_a_pipe, "no regular file"),
    "the scene cannot be read": Hostile(scene_cannot_be_read, "cannot be read|no regular file"),
    "the scene is a device": Hostile(lambda folder, outside: Path("/dev/zero"), "no regular file"),
    "the scene has a tab in its name": Hostile(
        lambda folder, outside: folder / "a\tb.xml", "control character in its name"
    ),
    "there is no scene": Hostile(lambda folder, outside: folder / "no.xml", "cannot be read"),
}

INCLUDES = {
    "itself": Hostile(parts(include("scene.xml")), "in a circle"),
    "in a circle": Hostile(
        with_files({"b.xml": f'<scene version="3.0.0">{include("scene.xml")}</scene>'},
                   include("b.xml")), "in a circle"
    ),
    "doubling": Hostile(include_bomb, "more than 1000 files"),
    "other file beside the included one": Hostile(
        with_files(
            {
                "x.xml": f'<scene version="3.0.0">{BALL}</scene>',
                "sub/inner.xml": f'<scene version="3.0.0">{include("x.xml")}</scene>',
                "sub/x.xml": '<scene version="3.0.0"><path value="/"/></scene>',
            },
            include("sub/inner.xml"),
        ),
        "beside an included file too",
    ),
    "other spectrum beside the included one": Hostile(
        with_files(
            {
                "a.spd": "400 1",
                "sub/inner.xml": '<scene version="3.0.0"><bsdf type="diffuse">'
                '<spectrum name="reflectance" filename="a.spd"/></bsdf></scene>',
                "sub/a.spd": "400 2",
            },
            include("sub/inner.xml"),
        ),
        "beside an included file too",
    ),
    "absolute": Hostile(parts(include("/etc/passwd")), "'/etc/passwd', which is outside"),
    "outside": Hostile(parts(include("../outside/secret.txt")), "which is outside"),
    "outside by a link": Hostile(
        with_link("a.xml", "OUTSIDE/secret.txt", include("a.xml")), "which is outside"
    ),
    "outside by a parameter": Hostile(
        parts('<default name="up" value=".."/>', include("$up/outside/secret.txt")),
        "which is outside",
    ),
    "outside by an escape": Hostile(
        parts(include("&#x2e;&#46;&#x2F;outside/secret.txt")), "which is outside"
    ),
    "FIFO outside": Hostile(parts(include("OUTSIDE/pipe")), "which is outside"),
    "FIFO": Hostile(with_pipe(include("pipe")), "no regular file"),
    "device": Hostile(parts(include("/dev/zero")), "which is outside"),
    "link to a device": Hostile(
        with_link("zero.xml", "/dev/zero", include("zero.xml")), "which is outside"
    ),
    "link to itself": Hostile(with_link("a.xml", "a.xml", include("a.xml")), "not in the scene"),
    "folder": Hostile(with_files({"sub/x": ""}, include("sub")), "no regular file"),
    "the scene's folder": Hostile(parts(include(".")), "outside|no regular file"),
    "missing": Hostile(parts(include("no.xml")), "not in the scene"),
    "no XML": Hostile(with_files({"a.xml": ply()}, include("a.xml")), "'a.xml', line 1.*UTF-8"),
    "value as root": Hostile(
        with_files({"a.xml": '<float name="x" value="1"/>'}, include("a.xml")), "begins with"
    ),
    "DOCTYPE inside": Hostile(
        with_files({"a.xml": f"<!DOCTYPE x>{EMPTY}"}, include("a.xml")), "'a.xml', line 1.*DOCTYPE"
    ),
    "path inside": Hostile(
        with_files({"a.xml": '<scene version="3.0.0"><path value="/"/></scene>'},
                   include("a.xml")), "<path> element"
    ),
    "plugins inside": Hostile(
        with_files({"sub/a.xml": EMPTY, "sub/plugins/x.so": ""}, include("sub/a.xml")),
        "'plugins' stands beside",
    ),
    "plugins beside a link": Hostile(
        with_link("b/a.xml", "../real/a.xml", include("b/a.xml"),
                  files={"real/a.xml": EMPTY, "b/plugins/x.so": ""}), "'plugins' stands beside"
    ),
    "plugins beside a link beside the included file": Hostile(
        with_link("sub/x/a.xml", "../../x/a.xml", include("sub/inner.xml"),
                  files={"sub/inner.xml": f'<scene version="3.0.0">{include("x/a.xml")}</scene>',
                         "x/a.xml": EMPTY, "sub/x/plugins/x.so": ""}), "'plugins' stands beside"
    ),
    "other file beside a link beside the included file": Hostile(
        with_link("sub/x/a.xml", "../../x/a.xml", include("sub/inner.xml"),
                  files={"sub/inner.xml": f'<scene version="3.0.0">{include("x/a.xml")}</scene>',
                         "x/a.xml": f'<scene version="3.0.0">{mesh_xml("m.ply")}</scene>',
                         "m.ply": ply(), "sub/x/m.ply": ply(faces=[(0, 1, 3)])}),
        "beside an included file too",
    ),
    "type by a parameter from outside": Hostile(
        with_files({"a.xml": f'<scene version="3.0.0">{shape("$kind")}</scene>'},
                   '<default name="kind" value="../evil"/>', include("a.xml")), "plugin type"
    ),
    "too deep by half": Hostile(
        with_files({"a.xml": f'<scene version="3.0.0">{nested(40)}</scene>'},
                   '<bsdf type="twosided">' * 30 + include("a.xml") + "</bsdf>" * 30), "deeper"
    ),
}  # fmt: skip

PLUGINS = {
    "folder": Hostile(with_files({"plugins/sphere.so": "x"}, BALL), "'plugins' stands beside"),
    "empty folder": Hostile(with_files({"plugins/.keep": ""}, BALL), "'plugins' stands beside"),
    "folder by a link": Hostile(with_link("plugins", "OUTSIDE", BALL), "'plugins' stands beside"),
    "beside the file that the scene is a link to": Hostile(
        scene_is_a_link_to_plugins, "'plugins' stands beside the scene file in 'sub'"
    ),
    "data in their place": Hostile(
        with_files({"data/ior/Au.eta.spd": "400 1"}, BALL), "'data/ior' stands beside"
    ),
    "slash": Hostile(parts(shape("../evil")), "plugin type '../evil'"),
    "absolute": Hostile(parts(shape("OUTSIDE/evil")), "plugin type"),
    "dots": Hostile(parts(shape("..")), "plugin type '..'"),
    "dot in front": Hostile(parts(shape("./sphere")), "plugin type './sphere'"),
    "ending": Hostile(parts(shape("sphere.so")), "plugin type 'sphere.so'"),
    "capital": Hostile(parts(shape("Sphere")), "Did you mean 'sphere'"),
    "space": Hostile(parts(shape("sphere ")), "plugin type 'sphere '"),
    "line break": Hostile(parts(shape("sphere&#10;")), "plugin type 'sphere.n'"),
    "nothing": Hostile(parts(shape("")), "plugin type ''"),
    "unknown": Hostile(parts(shape("spherre")), "'spherre'.*Did you mean 'sphere'.*Mend the scene"),
    "that takes places in memory": Hostile(
        parts('<shape type="blender"><integer name="vertices" value="4096"/></shape>'),
        "plugin type 'blender'",
    ),
    "of Python": Hostile(parts('<integrator type="prb"/>'), "plugin type 'prb'"),
    "scene within": Hostile(parts(shape("scene")), "plugin type 'scene'"),
    "by a parameter": Hostile(
        parts('<default name="x" value="../ev"/>', shape("${}il".replace("{}", "x"))), "plugin type"
    ),
    "of the root": Hostile(text('<scene version="3.0.0" type="../evil"/>'), "plugin type"),
    "of a spectrum": Hostile(
        parts('<bsdf type="diffuse"><spectrum name="reflectance" type="/evil"/></bsdf>'),
        "plugin type '/evil'",
    ),
    "in a transform": Hostile(
        parts('<shape type="sphere"><transform name="to_world"><bsdf type="../evil"/></transform>'
              "</shape>"), "plugin type"
    ),
}  # fmt: skip

FILE_NAMES = {
    "outside": Hostile(parts(mesh_xml("../outside/mesh.ply")), "which is outside"),
    "outside and back": Hostile(parts(mesh_xml("a/../../outside/mesh.ply")), "which is outside"),
    "absolute": Hostile(parts(mesh_xml("OUTSIDE/mesh.ply")), "which is outside"),
    "passwords": Hostile(parts(mesh_xml("/etc/passwd", "obj")), "'/etc/passwd', which is outside"),
    "device": Hostile(parts(mesh_xml("/dev/zero")), "which is outside"),
    "own memory": Hostile(parts(mesh_xml("/proc/self/mem")), "which is outside"),
    "FIFO outside": Hostile(parts(mesh_xml("OUTSIDE/pipe")), "which is outside"),
    "FIFO": Hostile(with_pipe(mesh_xml("pipe")), "no regular file"),
    "link": Hostile(with_link("a.ply", "OUTSIDE/mesh.ply", mesh_xml("a.ply")), "which is outside"),
    "relative link": Hostile(
        with_link("a.ply", "../outside/mesh.ply", mesh_xml("a.ply")), "which is outside"
    ),
    "link of a folder": Hostile(
        with_link("sub", "OUTSIDE", mesh_xml("sub/mesh.ply")), "which is outside"
    ),
    "link to a device": Hostile(with_link("z", "/dev/zero", mesh_xml("z")), "which is outside"),
    "parameter": Hostile(
        parts('<default name="x" value="../outside"/>', mesh_xml("$x/mesh.ply")), "outside"
    ),
    "half a parameter": Hostile(
        parts('<default name="x" value="."/>', mesh_xml("$x$x/outside/mesh.ply")), "outside"
    ),
    "folder": Hostile(with_files({"sub/x": ""}, mesh_xml("sub")), "no regular file"),
    "nothing": Hostile(parts(mesh_xml("")), "without giving its name"),
    "missing": Hostile(parts(mesh_xml("no.ply")), "'no.ply', which is not in the scene"),
    "line break": Hostile(parts(mesh_xml("a&#10;b.ply")), "has a line break or another control"),
    "very long": Hostile(parts(mesh_xml("a" * 5000)), "in 5,000 characters"),
    "of a spectrum": Hostile(
        parts('<bsdf type="diffuse"><spectrum name="reflectance" filename="/etc/passwd"/></bsdf>'),
        "which is outside",
    ),
    "of a texture": Hostile(parts(TEXTURE.format("/dev/zero")), "which is outside"),
    "of an environment": Hostile(
        parts('<emitter type="envmap"><string name="filename" value="../x.exr"/></emitter>', BALL),
        "which is outside",
    ),
    "in old spelling": Hostile(
        text(scene_xml('<shape type="ply"><string name="fileName" value="/etc/passwd"/></shape>',
                       version="0.5.0")), "which is outside"
    ),
    "hidden in a material": Hostile(
        parts('<bsdf type="conductor"><string name="material" value="../../x"/></bsdf>'),
        "which is outside",
    ),
    "hidden without slashes": Hostile(
        with_link("Au", "OUTSIDE/secret.txt",
                  '<bsdf type="conductor"><string name="material" value="Au"/></bsdf>'), "outside"
    ),
}  # fmt: skip

NUMBERS = {
    "film without width": Hostile(parts(BALL, film_xml("width", "0")), "film width is '0'"),
    "film of negative height": Hostile(parts(BALL, film_xml("height", "-1")), "film height"),
    "film of 200,000 pixels": Hostile(parts(film_xml("width", "200000")), "1 to 16384"),
    "film of 2^32 pixels": Hostile(parts(film_xml("width", "4294967296")), "1 to 16384"),
    "film of a word": Hostile(parts(film_xml("width", "wide")), "film width is 'wide'"),
    "film by a parameter": Hostile(
        parts('<default name="n" value="99999"/>', film_xml("height", "$n")), "is '99999'"
    ),
    "crop outside": Hostile(parts(film_xml("crop_width", "100000")), "crop_width"),
    "crop before": Hostile(parts(film_xml("crop_offset_x", "-9")), "crop_offset_x"),
    "field of view NaN": Hostile(parts(BALL, fov_xml("nan")), "fov is 'nan'"),
    "field of view infinite": Hostile(parts(BALL, fov_xml("inf")), "fov is 'inf'"),
    "field of view 0": Hostile(parts(BALL, fov_xml("0")), "0 to 180"),
    "field of view 180": Hostile(parts(BALL, fov_xml("180")), "0 to 180"),
    "field of view negative": Hostile(parts(BALL, fov_xml("-40")), "0 to 180"),
    "radius NaN": Hostile(
        parts('<shape type="sphere"><float name="radius" value="nan"/></shape>'),
        "bounding box|Mitsuba can load",
    ),
    "place NaN": Hostile(
        parts('<shape type="sphere"><point name="center" x="nan" y="0" z="0"/></shape>'),
        "bounding box|Mitsuba can load",
    ),
    "place infinite": Hostile(
        parts('<shape type="cube"><transform name="to_world"><translate x="inf"/></transform>'
              "</shape>"), "bounding box|Mitsuba can load"
    ),
    "number that is none": Hostile(
        parts('<shape type="sphere"><float name="radius" value="big"/></shape>'), "could not parse"
    ),
}  # fmt: skip

BEYOND = "vertex 3; allowed are whole numbers from 0 to 2"
DEEP = "".join(f"property uchar p{k}\n" for k in range(300))

PLY_FILES = {
    "index one too large": Hostile(mesh(ply(faces=[(0, 1, 3)])), BEYOND),
    "index far too large": Hostile(mesh(ply(faces=[(0, 1, 2**31 - 1)])), "vertex 2147483647"),
    "index -1": Hostile(mesh(ply(faces=[(0, 1, -1)])), "vertex -1"),
    "index too large, big-endian": Hostile(mesh(ply(faces=[(0, 1, 3)], order=">")), BEYOND),
    "index too large, text": Hostile(mesh(text_ply(faces="3 0 1 3\n")), BEYOND),
    "index -1, text": Hostile(mesh(text_ply(faces="3 0 1 -1\n")), "vertex -1"),
    "index 1.5, text": Hostile(mesh(text_ply(faces="3 0 1 1.5\n")), "whole numbers"),
    "index too large in a later face": Hostile(
        mesh(ply(faces=[(0, 1, 2)] * 999 + [(0, 3, 2)])), BEYOND
    ),
    "cut off in the faces": Hostile(mesh(ply()[:-5]), "there is room for 0"),
    "cut off in the vertices": Hostile(mesh(ply()[:-30]), "there is room"),
    "cut off in the header": Hostile(mesh(ply()[:60]), "no PLY header"),
    "cut off, text": Hostile(mesh(text_ply()[:-6]), "there is room"),
    "4 billion vertices": Hostile(mesh(ply(vertices=((0, 0, 0),) * 3).replace(
        b"vertex 3", b"vertex 4294967295")), "has 4,294,967,295 of element 'vertex'"),
    "10^18 faces": Hostile(mesh(ply().replace(b"face 1", b"face " + b"9" * 18)), "there is room"),
    "2^64 faces": Hostile(mesh(ply().replace(b"face 1", b"face " + b"9" * 20)), "header line"),
    "4 billion vertices, text": Hostile(
        mesh(text_ply().replace(b"vertex 3", b"vertex 4294967295")), "there is room"
    ),
    "-1 vertices": Hostile(mesh(ply().replace(b"vertex 3", b"vertex -1")), "header line"),
    "NaN": Hostile(mesh(ply([(0, 0, float("nan")), *((1, 0, 0),) * 2])), "no finite number"),
    "infinity": Hostile(mesh(ply([(0, 0, float("-inf")), *((1, 0, 0),) * 2])), "no finite number"),
    "NaN, text": Hostile(mesh(text_ply(vertices="0 0 nan\n1 0 4\n0 1 4\n")), "no finite number"),
    "1e300": Hostile(mesh(ply([(0, 0, 1e300), *((1, 0, 0),) * 2], kind="d")), "single precision"),
    "no vertices": Hostile(mesh(ply(vertices=())), "no element vertex"),
    "no faces": Hostile(mesh(ply(faces=())), "no element face"),
    "only vertices": Hostile(
        mesh(ply().replace(b"element face 1\nproperty list uchar int vertex_indices\n", b"")),
        "no element face",
    ),
    "empty": Hostile(mesh(b""), "is empty"),
    "no height": Hostile(mesh(ply().replace(b"float z", b"float w")), "no vertex property z"),
    "no list": Hostile(mesh(ply(listed="int vertex_indices")), "no face list"),
    "two lists": Hostile(
        mesh(ply(extra="property list uchar int vertex_index\n")),
        "the face lists vertex_indices and vertex_index",
    ),
    "list of fractions": Hostile(
        mesh(ply(listed="list uchar float vertex_indices")), "not of whole numbers"
    ),
    "list of four": Hostile(mesh(ply(faces=[(0, 1, 2, 0)])), "not three long"),
    "list of 255": Hostile(mesh(ply().replace(b"\x03\0\0\0\0", b"\xff\0\0\0\0")), "three long"),
    "list of two lengths": Hostile(
        mesh(ply(faces=[(0, 1, 2), (0, 1, 2, 0), (0, 1, 2)])), "not three long"
    ),
    "element twice": Hostile(
        mesh(ply(extra="element vertex 9\nproperty int x\n")), "names an element twice"
    ),
    "property twice": Hostile(
        mesh(ply().replace(b"float y", b"float x")), "two properties of one name"
    ),
    "300 properties": Hostile(mesh(ply(extra=DEEP)), "more than 256 properties"),
    "unknown type": Hostile(mesh(ply().replace(b"float z", b"quad z")), "header line"),
    "property of nothing": Hostile(
        mesh(b"ply\nformat ascii 1.0\nproperty int x\nend_header\n"), "header line"
    ),
    "unknown format": Hostile(mesh(ply_header("ebcdic").encode()), "header line"),
    "version 2.0": Hostile(mesh(ply().replace(b" 1.0", b" 2.0")), "header line"),
    "no format": Hostile(mesh(ply().replace(b"format", b"comment")), "says its format"),
    "endless header": Hostile(mesh(b"ply\n" + b"comment x\n" * 99_999), "no PLY header"),
    "word as number": Hostile(mesh(text_ply(vertices="0 0 x\n1 0 4\n0 1 4\n")), "a word where"),
    "an OBJ file": Hostile(mesh(obj()), "no PLY header"),
    "something after the end": Hostile(mesh(ply() + b"more"), "trailing content"),
}  # fmt: skip

OBJ_FILES = {
    "index 0": Hostile(mesh(obj(faces="f 0 1 2\n"), "obj"), "vertex 0; allowed.*from 1 to 3"),
    "index too large": Hostile(mesh(obj(faces="f 1 2 4\n"), "obj"), "vertex 4; allowed"),
    "index 2^32 + 1": Hostile(mesh(obj(faces="f 1 2 4294967297\n"), "obj"), "vertex 4294967297"),
    "index -1": Hostile(mesh(obj(faces="f -1 -2 -3\n"), "obj"), "vertex -3"),
    "texture index too large": Hostile(mesh(obj(faces="f 1/9 2/9 3/9\n"), "obj"), "Mitsuba can"),
    "normal index too large": Hostile(mesh(obj(faces="f 1//9 2//9 3//9\n"), "obj"), "Mitsuba can"),
    "NaN": Hostile(mesh(obj("v nan 0 0\nv 1 0 0\nv 0 1 0\n"), "obj"), "no finite number"),
    "infinity": Hostile(mesh(obj("v inf 0 0\nv 1 0 0\nv 0 1 0\n"), "obj"), "no finite number"),
    "1e39": Hostile(mesh(obj("v 1e39 0 0\nv 1 0 0\nv 0 1 0\n"), "obj"), "no finite number"),
    "no faces": Hostile(mesh(obj(faces=""), "obj"), "no vertices or no faces"),
    "no vertices": Hostile(mesh(obj(vertices=""), "obj"), "no vertices or no faces"),
    "face of two": Hostile(mesh(obj(faces="f 1 2\n"), "obj"), "fewer than three corners"),
    "vertex of two": Hostile(mesh(obj("v 1 2\nv 1 0 0\nv 0 1 0\n"), "obj"), "fewer than three"),
    "word as number": Hostile(mesh(obj("v x 0 0\nv 1 0 0\nv 0 1 0\n"), "obj"), "a word where"),
    "empty": Hostile(mesh(b"", "obj"), "is empty"),
    "a very long line": Hostile(mesh(obj() + b"# " + b"x" * 10_000, "obj"), "Mitsuba can load"),
    "a PLY file": Hostile(mesh(ply(), "obj"), "no vertices or no faces"),
}


def serialized(meshes: int, body: bytes = b"x" * 64, version: int = 4) -> bytes:
    offsets = struct.pack("<Q", 0)
    return struct.pack("<HH", 0x041C, version) + body + offsets + struct.pack("<I", meshes)


OTHER_FILES = {
    "serialized rubbish": Hostile(mesh(b"x" * 99, "serialized"), "serialized format"),
    "serialized, short": Hostile(mesh(b"\x1c\x04", "serialized"), "serialized format"),
    "serialized, 4 billion meshes": Hostile(
        mesh(serialized(2**32 - 1), "serialized"), "4,294,967,295 meshes"
    ),
    "serialized, no mesh": Hostile(mesh(serialized(0), "serialized"), "has 0 meshes"),
    "serialized, broken inside": Hostile(mesh(serialized(1), "serialized"), "Mitsuba can load"),
    "texture rubbish": Hostile(
        with_files({"a.png": b"\x89PNG\r\n\x1a\n" + b"x" * 99}, TEXTURE.format("a.png"), BALL),
        "Mitsuba can load",
    ),
    "texture cut off": Hostile(
        with_files({"a.exr": b"\x76\x2f\x31\x01"}, TEXTURE.format("a.exr"), BALL),
        "Mitsuba can load",
    ),
    "volume of 2^31 cells a side": Hostile(
        with_files(
            {"a.vol": b"VOL\x03" + struct.pack("<5i6f", 1, *(2**31 - 1,) * 3, 1, *(0.0,) * 6)},
            '<medium type="heterogeneous"><volume name="albedo" type="gridvolume">'
            '<string name="filename" value="a.vol"/></volume></medium>', BALL),
        "Mitsuba can load|memory|crashed",
    ),
    "reference to nothing": Hostile(
        parts('<shape type="sphere"><ref id="nothing"/></shape>'), "Mitsuba can load"
    ),
    "reference to itself": Hostile(
        parts('<bsdf type="twosided" id="a"><ref id="a"/></bsdf>', BALL),
        "Mitsuba can load|crashed",
    ),
    "id twice": Hostile(
        parts('<bsdf type="diffuse" id="a"/>', '<bsdf type="diffuse" id="a"/>'), "Mitsuba can load"
    ),
    "unknown parameter": Hostile(
        parts('<shape type="sphere"><float name="radiuss" value="2"/></shape>'), "radiuss"
    ),
    "version of nothing": Hostile(text(scene_xml(BALL, version="x.y")), "Mitsuba can load"),
}  # fmt: skip

CORPUS = {
    f"{group}: {name}": case
    for group, cases in {
        "document": DOCUMENTS, "include": INCLUDES, "plugin": PLUGINS, "file name": FILE_NAMES,
        "number": NUMBERS, "ply": PLY_FILES, "obj": OBJ_FILES, "other": OTHER_FILES,
        "flood": FLOODS,
    }.items()
    for name, case in cases.items()
}  # fmt: skip
"""All of them, by group and name."""

assert sys.getrecursionlimit() < 20_000, "the nested scene would not try a recursive reader"
