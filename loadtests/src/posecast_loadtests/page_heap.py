"""The page in a headless Chromium, and how much memory its scripts hold.

It drives Chromium through its debugging pipe (Chrome DevTools Protocol: JSON documents that each end with a
zero byte), so that nothing needs to be installed.
"""

from __future__ import annotations

import fcntl
import json
import os
import select
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

_ANSWER_S = 60.0  # a collection can take long on a busy machine
_COLLECTIONS = 5  # the page runs on between collection and reading, so take the least of several
_PHONE = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": False}
_HIGH = 10  # descriptors from here on, to avoid 3 and 4, which Chromium uses
_ARGUMENTS = (
    *("--headless", "--no-sandbox", "--no-first-run", "--remote-debugging-pipe"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1", "--window-size=390,844"),
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"),
)


_VIEW = """(() => {
  const scene = window.posecast?.scene;
  scene?.keepSharp?.();
  return scene ? (scene.keepSharp ? "3D" : "light") : "";
})()"""


class PageError(Exception):
    """Chromium failed to do something. The message is one line."""


class Heap(NamedTuple):
    """The heap of the page and its workers together, in 10⁶ bytes.

    `scripts_mb`: objects and the bytes of their buffers; `browser_mb`: what the browser holds for them
    (nodes, events).
    """

    scripts_mb: float
    browser_mb: float


class Page:
    """One page in a headless browser."""

    def __init__(self, orders: int, answers: int) -> None:
        self._orders = orders
        self._answers = answers
        self._heard = b""
        self._number = 0
        self._sessions: list[str] = []  # the page's, then its workers'

    def attach(self, url: str) -> None:
        """Attach to the page with this address. Raises PageError if it does not open."""
        end_s = time.monotonic() + _ANSWER_S
        while True:
            found = self._ask("Target.getTargets")["targetInfos"]
            mine = [t["targetId"] for t in found if t["type"] == "page" and t["url"].startswith(url)]
            if mine:
                break
            if time.monotonic() > end_s:
                raise PageError(f"page: Chromium did not open {url}")
            time.sleep(0.1)
        session = self._ask("Target.attachToTarget", targetId=mine[0], flatten=True)["sessionId"]
        self._sessions = [session]
        self._ask("Emulation.setDeviceMetricsOverride", session, **_PHONE)
        self._ask(
            "Target.setAutoAttach", session, autoAttach=True, waitForDebuggerOnStart=False, flatten=True
        )

    def text(self) -> str:
        """Return the text on the page."""
        asked = {"expression": "document.body.innerText", "returnByValue": True}
        return str(self._ask("Runtime.evaluate", self._sessions[0], **asked)["result"].get("value", ""))

    def view(self) -> str:
        """Return how the robot is shown: "3D", "light" (without WebGL), or "" if not yet.

        Once it is "3D", the page keeps full resolution and detail. A resolution that follows the machine's
        load would change memory by megabytes.
        """
        asked = {"expression": _VIEW, "returnByValue": True}
        return str(self._ask("Runtime.evaluate", self._sessions[0], **asked)["result"].get("value", ""))

    def heap(self) -> Heap:
        """Measure after a forced collection in the page and in each worker, while the stream runs."""
        found = [self._collected(session) for session in tuple(self._sessions)]
        return Heap(sum(heap.scripts_mb for heap in found), sum(heap.browser_mb for heap in found))

    def _collected(self, session: str) -> Heap:
        least = Heap(float("inf"), float("inf"))
        for _ in range(_COLLECTIONS):
            for _ in range(2):  # the second one frees what the finalizers of the first released
                self._ask("HeapProfiler.collectGarbage", session)
            used = self._ask("Runtime.getHeapUsage", session)
            scripts = used["usedSize"] + used.get("backingStorageSize", 0)
            least = min(least, Heap(scripts / 1e6, used.get("embedderHeapUsedSize", 0) / 1e6))
        return least

    def _ask(self, method: str, session: str | None = None, **params: Any) -> dict[str, Any]:
        self._number += 1
        order: dict[str, Any] = {"id": self._number, "method": method, "params": params}
        if session is not None:
            order["sessionId"] = session
        os.write(self._orders, json.dumps(order).encode() + b"\0")
        for said in self._hear():
            if said.get("id") == self._number:
                if "error" in said:
                    raise PageError(f"page: {method}: {said['error'].get('message')}")
                return dict(said["result"])
            self._note(said)
        raise PageError(f"page: no answer to {method}")

    def _note(self, event: dict[str, Any]) -> None:
        params = event.get("params", {})
        if event.get("method") == "Target.attachedToTarget" and self._sessions:
            self._sessions.append(params["sessionId"])
        elif event.get("method") == "Target.detachedFromTarget" and params["sessionId"] in self._sessions:
            self._sessions.remove(params["sessionId"])

    def _hear(self) -> Iterator[dict[str, Any]]:
        end_s = time.monotonic() + _ANSWER_S
        while True:
            while b"\0" in self._heard:
                document, _, self._heard = self._heard.partition(b"\0")
                yield json.loads(document)
            left_s = end_s - time.monotonic()
            if left_s <= 0 or not select.select([self._answers], [], [], left_s)[0]:
                return
            more = os.read(self._answers, 1 << 16)
            if not more:
                raise PageError("page: Chromium has ended")
            self._heard += more


@contextmanager
def page(executable: str, url: str, profile: str, folder: Path) -> Iterator[Page]:
    """Open `url` in a new Chromium, which ends with the block. Raises PageError if that fails."""
    with ExitStack() as stack:
        its_orders, orders = _pipe()
        answers, its_answers = _pipe()
        for end in (orders, answers):
            stack.callback(os.close, end)
        # Chromium reads commands from descriptor 3 and writes responses to 4
        shell = f'exec "$0" "$@" 3<&{its_orders} 4>&{its_answers}'
        log = stack.enter_context((folder / "chromium.log").open("w"))
        process = stack.enter_context(
            subprocess.Popen(
                ["bash", "-c", shell, executable, *_ARGUMENTS, f"--user-data-dir={profile}", url],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, pass_fds=(its_orders, its_answers),
            )
        )  # fmt: skip
        os.close(its_orders)
        os.close(its_answers)
        stack.callback(process.terminate)
        opened = Page(orders, answers)
        opened.attach(url)
        yield opened


def _pipe() -> tuple[int, int]:
    low = os.pipe()
    read, write = (fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, _HIGH) for end in low)
    for end in low:
        os.close(end)
    return read, write
