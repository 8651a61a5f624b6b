"""How names, texts and formats of strangers' files are read: a file that holds the page to the agent.

`python edge-agent/tests/test_reading_corpus.py` writes the file anew after a rule has changed.
"""

from __future__ import annotations

import codecs
import io
import json
import re
import struct
import sys
import tempfile
import unicodedata
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
import yaml

sys.path.insert(0, str(Path(__file__).parent))  # when run by itself

from model_stage import cube_glb
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes.mesh import UP_NOTES
from posecast_edge.model.meshes.reader import read_mesh
from posecast_edge.model.text import ENCODINGS
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.resolver import Resolver

FILE = Path(__file__).parent / "reading_corpus.json"
PAGE = FILE.parents[2] / "spa/src/urdf/text.ts"

# --- texts

WORDS = (
    "Größe_é",
    "łokieć",
    "ĉapelo",
    "ķirsis",
    "локоть",
    "مرفق",
    "αγκώνας",
    "מרפק",
    "ข้อศอก",
    "khuỷu",
    "机器人",
    "機器人",
    "ロボット",
    "로봇",
)


def urdf(name: str, head: str = "") -> str:
    """A robot whose link is called like it."""
    return f'{head}<robot name="{name}">\n  <link name="{name}"/>\n</robot>\n'


def declare(label: str) -> str:
    """An XML declaration."""
    return f'<?xml version="1.0" encoding="{label}"?>\n'


def word_for(codec: str) -> str:
    """One that the encoding has letters for."""
    if codec == "cp950":
        return "機器人"  # what else it has, its variants differ in
    words = WORDS[::-1] if codec in ("gb18030", "euc-jp", "cp932", "cp949") else WORDS
    return next((w for w in words if w.encode(codec, "ignore").decode(codec) == w), "cafe")


def list_encodings() -> Iterator[tuple[str, bytes, str]]:
    """(what it is, the file, the robot's name): each label, and every way in which files deviate from it."""
    for codec, labels in ENCODINGS.values():
        word = word_for(codec)
        yield from ((label, urdf(word, declare(label)).encode(codec), word) for label in labels.split())
        yield f"{codec} in capitals", urdf(word, declare(labels.split()[0].upper())).encode(codec), word
    word = "Größe_é_机"
    for mark, codec in ((codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be")):
        for label in ("", "utf-16", "utf-8", "gbk", "klingon"):
            text = urdf(word, declare(label) if label else "").encode(codec)
            yield f"{codec} that declares '{label}'", mark + text, word
            yield f"{codec} that declares '{label}', without its mark", text, word
    for label in ("", "utf-8", "utf-16", "klingon"):
        text = urdf(word, declare(label) if label else "").encode()
        yield f"utf-8 that declares '{label}'", text, word
        yield f"utf-8 that declares '{label}' after a comment", b"<!-- a -->\n" + text, word
        yield f"utf-8 with its mark that declares '{label}'", codecs.BOM_UTF8 + text, word
    for label in ("", "utf-8", "ascii", "klingon"):
        text = urdf("Größe_é", declare(label) if label else "").encode("latin-1")
        yield f"latin-1 that declares '{label}'", text, "Größe_é"
        yield f"latin-1 that declares '{label}', with a mark", codecs.BOM_UTF8 + text, "Größe_é"
    yield "latin-1 in a comment alone", b"<!-- x -->\n<!-- Gr\xf6\xdfe -->\n" + urdf("a").encode(), "a"
    yield "every letter of Windows", urdf("a").encode() + b"<!--" + bytes(range(0x80, 0x100)) + b"-->", "a"
    yield "a Windows dash", urdf("a\x96b").encode("latin-1"), "a–b"
    yield "utf-8 that declares gb2312", urdf("机", declare("gb2312")).encode(), "机"
    yield "cyrillic that declares gb2312", urdf("\xff\xff", declare("gb2312")).encode("latin-1"), "ÿÿ"


def list_outputs() -> Iterator[tuple[str, bytes, str]]:
    """What ROS's tools print."""
    word = 'Größe "x" o\'clock 机'
    name = word.replace('"', "&quot;")
    text = urdf(name, declare("utf-8")) + "\t<!-- \\ a long line: " + "word " * 40 + "-->\n"
    for kind, style in (("double", '"'), ("single", "'"), ("block", "|"), ("folded", ">"), ("plain", None)):
        for wide in (True, False):
            dumped = yaml.safe_dump({"data": text}, default_style=style, allow_unicode=wide)
            yield f"yaml {kind} {wide}", dumped.encode(), word
            yield f"yaml {kind} {wide}, as an echo ends", (dumped + "---\n").encode(), word
    for ascii_only in (True, False):
        dumped = json.dumps(text + "😀", ensure_ascii=ascii_only)
        yield f"json {ascii_only}", f"data: {dumped}\n---\n".encode(), word
        yield f"json {ascii_only} alone", dumped.encode(), word
        yield (
            f"json {ascii_only} of PowerShell",
            codecs.BOM_UTF16_LE + f"data: {dumped}\r\n".encode("utf-16-le"),
            word,
        )
    yield "a parameter", b"String value is: " + text.encode(), word
    yield "a parameter without a declaration", b"String value is: " + urdf(name).encode(), word
    yield "a parameter that begins with a comment", b"String value is: <!-- a -->" + urdf(name).encode(), word
    yield "a field", text.encode() + b"---\n", word
    yield (
        "after a warning",
        b"A message was lost!!!\n\ttotal count: 1\n---\ndata: " + json.dumps(text).encode(),
        word,
    )
    yield (
        "of a file of parameters",
        b"/x:\n  ros__parameters:\n    robot_description: " + json.dumps(text).encode(),
        word,
    )


ZIPPED = b"PK\3\4" + bytes(26)
NO_ROBOTS: dict[str, bytes] = {
    "nothing": b"",
    "zeros": bytes(40),
    "cut off": b"data: '" + declare("utf-8").encode() + b'<robot name="r"><link na...\'\n---\n',
    "cut off in double quotes": b'data: "<?xml version=\\"1.0\\"?>\\n<robot na..."\n---\n',
    "utf-32": urdf("a").encode("utf-32"),
    "half a letter of utf-16": urdf("a").encode("utf-16") + b"x",
    "html": b"<!DOCTYPE html><html><body>404</body></html>",
    "html after a comment": b"<!-- x --><html lang='en'>",
    "lfs": b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n",
    "usda": b"#usda 1.0\n(\n)\n",
    "usdc": b"PXR-USDC" + bytes(80),
    "usdz": ZIPPED + b"robot.usdc" + bytes(40),
    "zip": ZIPPED + b"robot.urdf" + bytes(40),
    "gzip": b"\x1f\x8b\x08" + bytes(40),
    "7z": b"7z\xbc\xaf\x27\x1c" + bytes(40),
    "world of Webots": b"#VRML_SIM R2023b utf8\nWorldInfo {}\n",
    "proto of Webots": b"PROTO Arm [\n]\n{ Robot {} }\n",
    "proto of Webots that names others": b'EXTERNPROTO "a.proto"\n',
    "vrml": b"#VRML V2.0 utf8\n",
    "ply": b"ply\nformat ascii 1.0\n",
    "fbx": b"Kaydara FBX Binary  \0",
    "step": b"ISO-10303-21;\nHEADER;\n",
    "blender": b"BLENDER-v300" + bytes(40),
    "fork": b"\0\5\x16\7\0\2\0\0Mac OS X",
    "png": b"\x89PNG\r\n\x1a\n",
    "pdf": b"%PDF-1.7\n",
    "srdf": b"<robot name='r'>\n<group name='arm'/><disable_collisions link1='a' link2='b'/></robot>",
    "launch": b"<launch>\n<node pkg='x'/></launch>",
    "package": b"<package><name>x</name></package>",
    "json": b'{"asset": {"version": "2.0"}}',
    "words": b"no robot at all",
    "words of python": b'URDF = """' + urdf("a").encode() + b'"""',
}

# --- meshes

CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0))
FACET = (
    "facet normal 0 0 1\nouter loop\n"
    + "".join(f"vertex {x} {y} {z}\n" for x, y, z in CORNERS)
    + "endloop\nendfacet\n"
)
OBJ = "# é\n" + "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS) + "f 1 2 3\n"
COLLADA = (
    '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
    '<asset><unit name="meter" meter="1"/><up_axis>Z_UP</up_axis></asset><library_geometries>'
    '<geometry id="g" name="é"><mesh><source id="p">'
    '<float_array id="f" count="9">0 0 0 1 0 0 0 1 0</float_array>'
    '<technique_common><accessor source="#f" count="3" stride="3"><param name="X" type="float"/>'
    '<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>'
    '<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="1">'
    '<input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry>'
    '</library_geometries><library_visual_scenes><visual_scene id="s"><node>'
    '<instance_geometry url="#g"/></node>'
    '</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>\n'
)


def binary_stl(count: int, claim: int, header: bytes = b"made by nobody") -> bytes:
    """`count` triangles; the header claims others."""
    face = struct.pack("<12fH", 0, 0, 1, *(float(v) for corner in CORNERS for v in corner), 0)
    return header.ljust(80, b"\0") + struct.pack("<I", claim) + face * count


def text_stl(name: str = "a") -> str:
    """One triangle."""
    return f"solid {name}\n{FACET}endsolid {name}\n"


def list_meshes() -> Iterator[tuple[str, bytes, int | None]]:
    """(the file's name, its content, its triangles); None: refused."""
    contents = {
        "obj": OBJ.encode(), "collada": COLLADA.encode(), "text stl": text_stl().encode(),
        "binary stl": binary_stl(1, 1), "glb": cube_glb(),
    }  # fmt: skip
    for what, content in contents.items():
        for suffix in (".stl", ".dae", ".obj", ".glb", ".STL"):
            yield f"{what}{suffix}", content, 12 if what == "glb" else 1
    for what, text in (("obj", OBJ), ("collada", COLLADA), ("stl", text_stl("é"))):
        yield f"{what} with a mark.stl", codecs.BOM_UTF8 + text.encode(), 1
        yield f"{what} in utf-16.stl", codecs.BOM_UTF16_LE + text.encode("utf-16-le"), 1
        yield f"{what} in utf-16 of others.stl", codecs.BOM_UTF16_BE + text.encode("utf-16-be"), 1
        yield f"{what} in latin-1.stl", text.encode("latin-1"), 1
        yield f"{what} with ends of Windows.stl", text.replace("\n", "\r\n").encode(), 1
        yield f"{what} after blanks.stl", b"\n \t" + text.encode(), 1
    yield (
        "collada that declares gbk.dae",
        declare("gbk").encode() + COLLADA.replace("é", "机").encode("gbk"),
        1,
    )
    yield "collada that lies.dae", declare("utf-8").encode() + COLLADA.encode("latin-1"), 1
    for n in (100, 4096, 9000):
        yield f"a name of {n}.stl", text_stl("x" * n).encode(), 1
    yield "shouted.stl", text_stl().upper().replace("VERTEX", "vertex").encode(), 1
    yield "an empty text.stl", b"solid a\nendsolid a\n", None
    yield "a binary that begins so.stl", binary_stl(2, 2, b"solid of facet normal"), 2
    for count in (1, 3, 10):
        yield f"no claim but {count}.stl", binary_stl(count, 0), count
        yield f"no claim but {count}.obj", binary_stl(count, 0), count
    yield "no triangle.stl", binary_stl(0, 0), None
    yield "bytes after the last.stl", binary_stl(2, 2) + b"xyz", 2
    yield "fewer than claimed.stl", binary_stl(2, 3), None
    yield "far fewer than claimed.stl", binary_stl(2, 4_000_000_000), None
    yield "three of two.stl", binary_stl(3, 2), 2
    yield "not a number.stl", text_stl().replace("vertex 1", "vertex one").encode(), None
    yield "half a triangle.stl", text_stl().replace("vertex 1 0 0\n", "").encode(), None
    for name in (
        "html",
        "lfs",
        "usda",
        "zip",
        "7z",
        "world of Webots",
        "vrml",
        "ply",
        "fbx",
        "step",
        "fork",
        "png",
    ):
        for suffix in (".stl", ".obj"):
            yield f"{name}{suffix}", NO_ROBOTS[name], None
    yield (
        "words.stl",
        b"neither one nor the other, but long enough to hold a header of eighty-four bytes, really",
        None,
    )
    yield "nothing.obj", b"", None


# --- names

NFC, NFD = "Größe_é 팔.stl", unicodedata.normalize("NFD", "Größe_é 팔.stl")
ON_DISK = (
    "part#1.stl", "what?.stl", "arm%20v2.stl", "arm v2.stl", "100%.stl", "a+b&c;d=e.stl", "[x] (1).stl",
    "Größe.stl", NFC, NFD, "UPPER.STL", "机器人.stl", "a%23b#c.stl", "it's.stl",
)  # fmt: skip
WAYS = (
    "package://my_bot/meshes/{}", "package:///my_bot/meshes/{}", "package:/my_bot/meshes/{}",
    "model://my_bot/meshes/{}", "Package://my_bot//meshes/{}", "package://my_bot/meshes/../meshes/{}",
    "package://renamed/meshes/{}", "package://renamed/old/deep/meshes/{}", "../meshes/{}", "..\\meshes\\{}",
    "./../meshes/{}", "meshes/{}", "file://meshes/{}", "file:meshes/{}", "file://../meshes/{}",
    "file:///C:/Users/me/my_bot/meshes/{}", "file://C:/Users/me/my_bot/meshes/{}",
    "C:\\Users\\me\\my_bot\\meshes\\{}", "file:///home/nobody/my_bot/meshes/{}", "/home/nobody/meshes/{}",
    "file://localhost/home/nobody/meshes/{}", "MESHES/{}",
)  # fmt: skip
NOWHERE = (
    "package://my_bot/meshes/gone.stl", "../meshes/gone.stl", "gone.stl", "package://my_bot/gone%20too.stl",
    "file:gone.stl", "http://x.org/a.stl", "package://my_bot/visual/deep.stl", "../notes.txt", "../scan.step",
    "package://my_bot/scan.step", "../points.pcd", "package://my_bot/part#1", "package://my_bot", "x\0.stl",
)  # fmt: skip


def spell(name: str) -> list[str]:
    """Every way in which people write a name."""
    ways = [name, quote(name), name.replace(" ", "%20"), unicodedata.normalize("NFD", name)]
    ways += [unicodedata.normalize("NFC", name), quote(unicodedata.normalize("NFC", name)), name.swapcase()]
    return list(dict.fromkeys(way for way in ways if "%" not in name or way in (name, quote(name))))


def place(folder: Path, name: str) -> Path:
    """The robot's package with a mesh of that name, and other files. Returns its URDF."""
    for file in (
        f"meshes/{name}",
        "visual/one/deep.stl",
        "visual/two/deep.stl",
        "notes.txt",
        "scan.step",
        "points.pcd",
    ):
        (folder / "my_bot" / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / "my_bot" / file).write_bytes(b"x")
    (folder / "my_bot/package.xml").write_text("<package><name>my_bot</name></package>")
    path = folder / "my_bot/urdf/r.urdf"
    path.parent.mkdir()
    path.write_text("<robot/>")
    return path


# --- the file


def read_text_row(what: str, content: bytes) -> dict[str, Any]:
    """What the agent makes of a robot's text."""
    row: dict[str, Any] = {"what": what, "bytes": content.decode("latin-1")}
    try:
        robot = read_urdf(io.BytesIO(content))
    except ModelRefused as e:
        return row | {"refused": e.reason}
    findings = [[f.severity, f.code, f.text, f.line] for f in robot.findings]
    return row | {"name": robot.name, "links": [x.name for x in robot.links], "findings": findings}


def read_mesh_row(name: str, content: bytes, folder: Path) -> dict[str, Any]:
    """What the agent makes of a mesh."""
    row: dict[str, Any] = {"file": name, "bytes": content.decode("latin-1")}
    path = folder / name
    path.write_bytes(content)
    try:
        mesh = read_mesh(path, Resolver(folder / "r.urdf"))
    except ModelRefused as e:
        return row | {"refused": e.reason}
    return row | {
        "triangles": sum(len(s.faces) for s in mesh.surfaces),
        "notes": [note for note in mesh.notes if note[0] not in UP_NOTES],
    }  # the builder says how it is turned


def find_row(name: str, folder: Path) -> dict[str, Any]:
    """Where the agent finds each spelling of a name."""
    path = place(folder, name)
    resolver = Resolver(path)

    def find(uri: str) -> list[str | None]:
        try:
            one = resolver.find_file(uri)
        except ModelRefused as e:
            return [None, e.reason]
        return [str(one.path.relative_to(folder)), one.hint]

    found = {uri: find(uri) for uri in [*(way.format(one) for way in WAYS for one in spell(name)), *NOWHERE]}
    files = sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
    return {"files": files, "urdf": "my_bot/urdf/r.urdf", "found": found}


@cache
def corpus() -> str:
    """The file's text."""
    texts = [read_text_row(what, content) for what, content, _ in (*list_encodings(), *list_outputs())]
    texts += [read_text_row(what, content) for what, content in NO_ROBOTS.items()]
    with tempfile.TemporaryDirectory() as folder:
        meshes = [read_mesh_row(name, content, Path(folder)) for name, content, _ in list_meshes()]
    names = []
    for name in ON_DISK:
        with tempfile.TemporaryDirectory() as folder:
            names.append(find_row(name, Path(folder)))
    parts = {"texts": texts, "meshes": meshes, "names": names}
    rows = [f'"{part}": [\n' + ",\n".join(map(json.dumps, some)) + "\n]" for part, some in parts.items()]
    return "{\n" + ",\n".join(rows) + "\n}\n"


def test_the_page_is_held_to_what_the_agent_reads() -> None:
    assert FILE.read_text(encoding="utf-8") == corpus(), f"run python {Path(__file__).name}"


@pytest.mark.parametrize("part", ["encodings", "outputs"])
def test_every_text_is_read_right(part: str) -> None:
    rows = {row["what"]: row for row in json.loads(corpus())["texts"]}
    listed = list(list_encodings() if part == "encodings" else list_outputs())
    assert len(listed) > 25
    for what, _, word in listed:
        assert rows[what].get("name") == word, rows[what]
        assert rows[what]["links"] == [word], what


def test_what_is_no_robot_is_called_by_its_name() -> None:
    rows = {row["what"]: row for row in json.loads(corpus())["texts"]}
    for what in NO_ROBOTS:
        assert "refused" in rows[what], what
    named = [rows[what]["refused"] for what in NO_ROBOTS if "words" not in what]
    assert not [reason for reason in named if "not XML" in reason]


def test_every_mesh_is_read_right() -> None:
    rows = {row["file"]: row for row in json.loads(corpus())["meshes"]}
    for name, _, triangles in list_meshes():
        assert rows[name].get("triangles") == triangles, rows[name]


def test_every_name_is_found() -> None:
    for row, name in zip(json.loads(corpus())["names"], ON_DISK, strict=True):
        for uri, (path, reason) in row["found"].items():
            assert path == (None if uri in NOWHERE else f"my_bot/meshes/{name}"), (uri, reason)


def test_the_page_knows_the_same_encodings() -> None:
    table = re.search(r"ENCODINGS[^{]*\{(.*?)\};", PAGE.read_text("utf-8"), re.DOTALL)
    assert table is not None
    found = dict(re.findall(r"'?([\w-]+)'?: '([^']+)',", table[1]))
    assert found == {name: labels for name, (_, labels) in ENCODINGS.items()}


if __name__ == "__main__":
    FILE.write_text(corpus(), encoding="utf-8")
