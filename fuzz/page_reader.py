"""The page's readers in a Node of their own, fed with cases one after the other: `fuzz/page/serve.ts`."""

from __future__ import annotations

import functools
import json
import os
import select
import struct
import subprocess
from pathlib import Path
from typing import Any
from xml.parsers import expat

from fuzz.scratch import new_folder
from fuzz.target import CLOCK, Gone, Refused, TooDear, slowness

HERE = Path(__file__).parent / "page"
PATIENCE_S = 60.0  # for one answer; what takes longer has hung
HEAP_MB = 512
UNBOUND_PREFIX = expat.errors.codes[expat.errors.XML_ERROR_UNBOUND_PREFIX]
LENGTH = struct.Struct("<I")
HEAD = struct.Struct("<IIH")  # CPU time, µs; growth of its memory, KiB; counters hit
MS, MS_PER_KB = 150.0, 8.0  # CPU time that a case may take; its compiler and collector count too
MB, MB_PER_KB = 64.0, 2.0

try:
    import atheris
except ModuleNotFoundError:
    atheris = None


class PageFault(Exception):
    """The page's reader threw what it does not promise. The text is JavaScript's stack."""


class Page:
    """One Node. It ends with this process, or when it is asked nothing for ever."""

    def __init__(self, bundle: Path) -> None:
        # a stack as browsers give it, and no more memory than a phone has
        command = ["node", f"--max-old-space-size={HEAP_MB}", str(bundle)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._to, self._from = self._process.stdin.fileno(), self._process.stdout.fileno()
        assert self._message() == b"ready"

    def ask(self, target: str, data: bytes) -> Any:
        """What `target` makes of it, as JSON says it. Refused; PageFault, Gone, TooDear are findings."""
        answer, spent_ms, grown_mb, ways = self._ask(target, data)
        _tell(ways)
        kb = len(data) / 1024
        if grown_mb > MB + MB_PER_KB * kb:
            raise TooDear(f"{grown_mb:.0f} MB in Node for {kb:.1f} KB")
        if spent_ms > MS + MS_PER_KB * kb:
            spent_ms = min(spent_ms, self._ask(target, data)[1], self._ask(target, data)[1])
        CLOCK.elsewhere_s += spent_ms / 1000
        if spent_ms > MS + MS_PER_KB * kb and spent_ms > (MS + MS_PER_KB * kb) * slowness():
            raise TooDear(f"{spent_ms:.0f} ms in Node for {kb:.1f} KB")
        if "fault" in answer:
            raise PageFault(answer["fault"])
        if "refused" in answer:
            raise Refused(answer["refused"])
        return answer.get("value")

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.wait()

    def ways(self, target: str, data: bytes) -> tuple[int, ...]:
        """The ways that TypeScript takes over a case, by number."""
        return self._ask(target, data)[3]

    def _ask(self, target: str, data: bytes) -> tuple[dict[str, Any], float, float, tuple[int, ...]]:
        self._send(bytes((len(target),)) + target.encode() + data)
        while (message := self._message())[:1] == b"X":
            self._send(json.dumps(xml_tree(message[1:])).encode())
        spent_us, grown_kb, count = HEAD.unpack_from(message, 1)
        ways = struct.unpack_from(f"<{count}H", message, 1 + HEAD.size)
        answer = json.loads(message[1 + HEAD.size + 2 * count :], object_hook=_number)
        return answer, spent_us / 1000, grown_kb / 1024, ways

    def _send(self, message: bytes) -> None:
        left = memoryview(LENGTH.pack(len(message)) + message)
        try:
            while left:
                left = left[os.write(self._to, left) :]
        except BrokenPipeError:
            raise Gone("Node has ended") from None

    def _message(self) -> bytes:
        return self._take(LENGTH.unpack(self._take(LENGTH.size))[0])

    def _take(self, size: int) -> bytes:
        parts = []
        while size:
            if not select.select([self._from], [], [], PATIENCE_S)[0]:
                raise Gone(f"Node has not answered for {PATIENCE_S:g} s")
            part = os.read(self._from, size)
            if not part:
                raise Gone("Node has ended")
            parts.append(part)
            size -= len(part)
        return b"".join(parts)


@functools.cache
def bundled() -> Path:
    """The readers in one file, built once for a process and its children."""
    out = new_folder() / "page.mjs"
    subprocess.run(["node", str(HERE / "build.mjs"), str(out)], check=True)
    return out


_pages: dict[int, Page] = {}


def page() -> Page:
    """This process's own."""
    pid = os.getpid()
    if pid not in _pages:
        _pages[pid] = Page(bundled())
    return _pages[pid]


def ask(target: str, data: bytes) -> Any:
    """As Page.ask. A Node that is gone is replaced for the next one."""
    try:
        return page().ask(target, data)
    except Gone:
        _pages.pop(os.getpid()).close()
        raise


@functools.cache
def _counters(most: int = 4096) -> list[int]:
    return [atheris._reserve_counter() for _ in range(most)]


def _tell(ways: tuple[int, ...]) -> None:
    """libFuzzer, where there is one."""
    if atheris is None:
        return
    counters = _counters()
    trace = atheris._trace_branch  # another one once libFuzzer runs
    for number in ways:
        if number < len(counters):
            trace(counters[number])


def _number(found: dict[str, Any]) -> Any:
    return float(found["odd"].replace("Infinity", "inf")) if found.keys() == {"odd"} else found


def xml_tree(text: bytes) -> list[Any] | int:
    """Tag, attributes and children, as a browser sees them; the line of the error where it is no XML.

    A prefix must be declared, as in a browser; other sins against namespaces (`<a:b:c>`) are passed over.
    """
    try:
        parser = expat.ParserCreate("utf-8")
        stack: list[list[Any]] = [["", {}, []]]

        def start(tag: str, attributes: dict[str, str]) -> None:
            element: list[Any] = [tag, attributes, []]
            stack[-1][2].append(element)
            stack.append(element)

        parser.StartElementHandler = start
        parser.EndElementHandler = lambda _: stack.pop()
        parser.Parse(text, True)
    except expat.ExpatError as e:
        return e.lineno
    try:
        expat.ParserCreate("utf-8", namespace_separator=" ").Parse(text, True)
    except expat.ExpatError as e:
        if e.code == UNBOUND_PREFIX:
            return e.lineno
    root: list[Any] = stack[0][2][0]
    return root
