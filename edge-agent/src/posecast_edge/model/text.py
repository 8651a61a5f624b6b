"""Reads text from untrusted files as the page does (spa/src/urdf/text.ts): by its byte order mark, then by
the encoding that its XML declaration names, then as UTF-8, then as Latin-1, with a finding. Takes a robot's
description out of the output of ROS's tools.

`edge-agent/tests/reading_corpus.json` holds the two readers to each other.
"""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass

from posecast_edge.model.content import ROBOT, WIDE, refuse_foreign
from posecast_edge.model.finding import Finding, ModelRefused, quote_name

# The labels of each encoding, and Python's codec for what browsers (WHATWG) mean by them. "ascii" is read as
# UTF-8, and the encodings by which files lie most often, UTF-16 without a second byte, as what they are.
ENCODINGS = {
    "utf-8": ("utf-8", "utf-8 utf8 us-ascii ascii"),
    "windows-1250": ("cp1250", "windows-1250 cp1250"),
    "windows-1251": ("cp1251", "windows-1251 cp1251"),
    "windows-1252": ("cp1252", "windows-1252 cp1252 iso-8859-1 iso8859-1 iso_8859-1 latin1 latin-1 l1"),
    "windows-1253": ("cp1253", "windows-1253 cp1253"),
    "windows-1254": ("cp1254", "windows-1254 cp1254 iso-8859-9 iso8859-9 latin5"),
    "windows-1255": ("cp1255", "windows-1255 cp1255"),
    "windows-1256": ("cp1256", "windows-1256 cp1256"),
    "windows-1257": ("cp1257", "windows-1257 cp1257"),
    "windows-1258": ("cp1258", "windows-1258 cp1258"),
    "windows-874": ("cp874", "windows-874 tis-620 iso-8859-11"),
    "iso-8859-2": ("iso8859-2", "iso-8859-2 iso8859-2 latin2"),
    "iso-8859-3": ("iso8859-3", "iso-8859-3 iso8859-3 latin3"),
    "iso-8859-4": ("iso8859-4", "iso-8859-4 iso8859-4 latin4"),
    "iso-8859-5": ("iso8859-5", "iso-8859-5 iso8859-5 cyrillic"),
    "iso-8859-6": ("iso8859-6", "iso-8859-6 iso8859-6 arabic"),
    "iso-8859-7": ("iso8859-7", "iso-8859-7 iso8859-7 greek"),
    "iso-8859-8": ("iso8859-8", "iso-8859-8 iso8859-8 hebrew"),
    "iso-8859-10": ("iso8859-10", "iso-8859-10 iso8859-10 latin6"),
    "iso-8859-13": ("iso8859-13", "iso-8859-13 iso8859-13"),
    "iso-8859-14": ("iso8859-14", "iso-8859-14 iso8859-14"),
    "iso-8859-15": ("iso8859-15", "iso-8859-15 iso8859-15 latin9"),
    "koi8-r": ("koi8-r", "koi8-r koi8"),
    "koi8-u": ("koi8-u", "koi8-u"),
    "ibm866": ("cp866", "ibm866 cp866"),
    "macintosh": ("mac-roman", "macintosh x-mac-roman"),
    "gb18030": ("gb18030", "gb18030 gbk gb2312 gb_2312-80 chinese x-gbk cp936"),
    "big5": ("cp950", "big5 big5-hkscs cp950"),
    "euc-jp": ("euc-jp", "euc-jp x-euc-jp"),
    "shift_jis": ("cp932", "shift_jis shift-jis sjis windows-31j ms932 cp932"),
    "euc-kr": ("cp949", "euc-kr ks_c_5601-1987 windows-949 cp949"),
}
CODECS = {label: codec for codec, labels in ENCODINGS.values() for label in labels.split()}
UNTRUE = "utf-16", "utf-16le", "utf-16be", "ucs-2"  # declarations that can't be read where they are true

LATIN = "".join(
    chr(b) if b in (0x81, 0x8D, 0x8F, 0x90, 0x9D) else bytes([b]).decode("cp1252") for b in range(256)
)
BLANKS = re.compile(rb"\s+")
DECLARATION_MAX = 200  # bytes
DECLARED = re.compile(rb"""\sencoding\s*=\s*["']([\w.:-]{1,40})["']""")
CHUNK = 1 << 20
HEAD = 64 << 10  # bytes in which a declaration may begin
LATIN_TEXT = (
    "a byte that is not UTF-8; the file is read as Latin-1: save it as UTF-8, or declare its encoding in the "
    "first line"
)


@dataclass(frozen=True)
class Text:
    """A file's text in UTF-8, without byte order mark and XML declaration, and what was found on the way."""

    utf8: bytes
    findings: tuple[Finding, ...] = ()


def read_text(data: bytes) -> Text:
    """Decode a file. Raises ModelRefused when it is broken UTF-16."""
    if data.startswith((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)):
        raise ModelRefused("UTF-32 text, which is not supported: save it as UTF-8")
    if codec := WIDE.get(data[:2]):
        return Text(_without_declaration(_from_wide(data, codec)))
    data = data.removeprefix(codecs.BOM_UTF8)
    declared = _declared(data)
    known = CODECS.get(declared.lower())
    plain = _without_declaration(data)
    found: tuple[Finding, ...] = ()
    if known not in (None, "utf-8"):
        try:
            return Text(_decode(plain, known).encode())
        except UnicodeError:
            found = (_note(f"its bytes are not what it declares, {quote_name(declared)}", 1),)
    elif known is None and declared and declared.lower() not in UNTRUE:
        found = (_note(f"the encoding {quote_name(declared)} is not known", 1),)
    if _is_utf8(plain):
        return Text(plain, found)
    line = plain.decode("utf-8", "replace").partition("�")[0].count("\n") + 1
    text = codecs.charmap_decode(plain, "strict", LATIN)[0]
    return Text(text.encode(), (*found, _note(LATIN_TEXT, line)))


def _note(text: str, line: int) -> Finding:
    return Finding("warning", "encoding", text, line)


def _from_wide(data: bytes, codec: str) -> bytes:
    try:
        return data.decode(codec).removeprefix("\ufeff").encode()
    except UnicodeError:
        raise ModelRefused("broken UTF-16 text: save it as UTF-8") from None


def _decode(data: bytes, codec: str) -> str:
    """Raises UnicodeError. What a Windows encoding leaves open is a control character, as in browsers."""
    if codec.startswith("cp125"):
        table = "".join(bytes([b]).decode(codec, "replace") for b in range(256))
        table = "".join(
            chr(b) if c == "�" and b < 0xA0 else "\ufffe" if c == "�" else c for b, c in enumerate(table)
        )
        return codecs.charmap_decode(data, "strict", table)[0]
    return data.decode(codec)


def _is_utf8(data: bytes) -> bool:
    """Without a copy of the whole text."""
    decoder = codecs.getincrementaldecoder("utf-8")()
    try:
        for at in range(0, len(data), CHUNK):
            decoder.decode(data[at : at + CHUNK])
        decoder.decode(b"", True)
    except UnicodeError:
        return False
    return True


# --- the XML declaration, which ROS's reader accepts after blanks and comments too


def _declared(data: bytes) -> str:
    """The encoding that it names, "" without one."""
    at, end = _declaration(data)
    found = DECLARED.search(data, at, end)
    return found[1].decode("ascii", "replace") if found else ""


def _without_declaration(data: bytes) -> bytes:
    """It may name another encoding than the text has by now, so it becomes blanks."""
    at, end = _declaration(data)
    return data[:at] + re.sub(rb"[^\n]", b" ", data[at:end]) + data[end:] if end else data


def _declaration(data: bytes) -> tuple[int, int]:
    """Where it begins and ends; (0, 0) without one."""
    data, at = data[:HEAD], 0
    while True:
        blanks = BLANKS.match(data, at)
        at = at if blanks is None else blanks.end()
        if not data.startswith(b"<!--", at):
            break
        end = data.find(b"-->", at + 4)
        if end < 0:
            return 0, 0
        at = end + 3
    end = data.find(b"?>", at, at + DECLARATION_MAX)
    return (at, end + 2) if end >= 0 and data.startswith(b"<?xml", at) else (0, 0)


# --- a robot's description, as ROS's tools print it

PREAMBLE = re.compile(r"""[^<]{1,1000}(?=<(?:\?xml\s|!--|robot[\s>]))""")
QUOTE = re.compile(r"""(["'])(?:\\[nrt ]|\s)*\Z""")
ESCAPE = re.compile(r"\\(?:x([0-9A-Fa-f]{2})|u([0-9A-Fa-f]{4})|U([0-9A-Fa-f]{8})|\r?\n[ \t]*|(.))", re.DOTALL)
LETTERS = {"n": "\n", "t": "\t", "r": "\r", "0": "", "a": "", "b": "", "e": "", "f": "", "v": ""}
LETTERS |= {"N": "\x85", "_": "\xa0", "L": "\u2028", "P": "\u2029"}
CUT_OFF = "cut off by ros2 topic echo: repeat the command with --full-length"


def read_robot_text(data: bytes) -> Text:
    """Decode a robot's description, also from the output of `ros2 topic echo` or `ros2 param get`. Raises
    ModelRefused, which names it, when it is no text of a robot at all."""
    refuse_foreign(data, ROBOT)
    text = read_text(data)
    before = PREAMBLE.match(text.utf8[:8192].decode("utf-8", "ignore"))
    if before is None or not before[0].strip():
        return text
    taken = text.utf8.decode()[before.end() :]
    quoted = QUOTE.search(before[0])
    if quoted is not None:
        taken = _unescape(taken) if quoted[1] == '"' else _between(taken, "'").replace("''", "'")
    if "</robot" not in taken and taken.rstrip().rstrip("-").rstrip().endswith("..."):
        raise ModelRefused(CUT_OFF)
    shown = quote_name(" ".join(before[0].split()), 40)
    note = Finding(
        "hint", "taken-out", f"the robot's description was taken out behind {shown}; lines count from there"
    )
    return Text(_without_declaration(taken.encode("utf-8", "replace")), (*text.findings, note))


def _between(text: str, quote: str) -> str:
    """Up to the quote that ends it; a doubled one, or one behind a backslash, doesn't."""
    at = text.find(quote)
    while at >= 0:
        if quote == "'" and text.startswith("''", at):
            at = text.find(quote, at + 2)
        elif quote == '"' and _is_escaped(text, at):
            at = text.find(quote, at + 1)
        else:
            return text[:at]
    return text


def _is_escaped(text: str, at: int) -> bool:
    back = at
    while back > 0 and text[back - 1] == "\\":
        back -= 1
    return (at - back) % 2 == 1


def _unescape(text: str) -> str:
    """A string of YAML or JSON in double quotes."""

    def plain(match: re.Match[str]) -> str:
        digits, letter = match[1] or match[2] or match[3], match[4]
        if digits is not None:
            return chr(code) if (code := int(digits, 16)) < 0x110000 else "�"
        return "" if letter is None else LETTERS.get(letter, letter)

    found = ESCAPE.sub(plain, _between(text, '"'))
    return found.encode("utf-16", "surrogatepass").decode("utf-16", "replace")  # pairs, as JSON writes them
