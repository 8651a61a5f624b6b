"""A test double of a Firebase Realtime Database: its REST and streaming protocol, as far as we speak it.

    python tests/rtdb_double.py [RULES.json]        prints `http://127.0.0.1:PORT`

It is a double, not Google's: it shows what we ask and how we take what comes back, not Google's limits,
latency or language of rules. Of rules it knows `.read` and `.write` with true or false, by path, `$name` for
any; without a file all is open. `Authorization: Bearer owner` stands for a service account.

    GET /.double    {"requests": {"PATCH": n}, "at_once": most at a time, "streams": now, "bytes", "tree"}
    POST /.double   {"answer": 503}: every request is answered so. {"hang": true}: none is.
                    {"cancel": true}: streams are told that the rules have changed.
                    {"cut": true}: streams end. {}: all is well again
"""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
from collections import Counter
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route

RULES = Path(__file__).parents[1] / "infra/firebase/database.rules.json"
KEEP_ALIVE_S = 30.0
HEADERS = {"access-control-allow-origin": "*", "cache-control": "no-cache"}
Path_ = tuple[str, ...]


class Database:
    """The tree, its listeners, and what has been asked of it."""

    def __init__(self, rules: dict[str, Any] | None) -> None:
        self.rules = rules
        self.tree: Any = None
        self.listeners: dict[asyncio.Queue[tuple[str, Any] | None], Path_] = {}
        self.requests: Counter[str] = Counter()
        self.now_at_once = self.at_once = self.bytes = 0
        self.fault: dict[str, Any] = {}

    def at(self, path: Path_) -> Any:
        """What stands there; None for nothing."""
        found = self.tree
        for part in path:
            found = found.get(part) if isinstance(found, dict) else None
        return found

    def put(self, path: Path_, value: Any) -> None:
        """Replaces what stands there. An empty node does not exist."""
        self.tree = _with(self.tree, path, value)

    def allows(self, what: str, path: Path_) -> bool:
        """By the rules: what is granted above holds below."""
        if self.rules is None:
            return True
        rule: Any = self.rules["rules"]
        granted = rule.get(what) is True
        for part in path:
            named = rule.get(part)
            rule = named if named is not None else next((v for k, v in rule.items() if k.startswith("$")), {})
            granted = granted or rule.get(what) is True
        return granted

    def tell(self, path: Path_, changed: dict[Path_, Any] | None) -> None:
        """`changed`: below `path`, by an update; None: `path` itself was replaced."""
        for queue, listened in self.listeners.items():
            if changed is None:
                if path[: len(listened)] == listened:
                    queue.put_nowait(("put", _event(path[len(listened) :], self.at(path))))
                elif listened[: len(path)] == path:
                    queue.put_nowait(("put", _event((), self.at(listened))))
                continue
            places = [(*path, *below) for below in changed]
            if any(listened[: len(place)] == place for place in places):  # all of what is listened to
                queue.put_nowait(("put", _event((), self.at(listened))))
                continue
            mine = {
                place[len(listened) :]: self.at(place)
                for place in places
                if place[: len(listened)] == listened
            }
            if mine:
                data = {"/".join(below): value for below, value in mine.items()}
                queue.put_nowait(("patch", {"path": "/", "data": data}))


def _event(path: Path_, value: Any) -> dict[str, Any]:
    return {"path": "/" + "/".join(path), "data": value}


def _with(tree: Any, path: Path_, value: Any) -> Any:
    if not path:
        return value
    node = dict(tree) if isinstance(tree, dict) else {}
    below = _with(node.get(path[0]), path[1:], value)
    if below is None or below == {}:
        node.pop(path[0], None)
    else:
        node[path[0]] = below
    return node or None


def _path(text: str) -> Path_:
    return tuple(part for part in text.split("/") if part)


def make_app(db: Database) -> Starlette:
    """The double as an ASGI application."""

    async def control(request: Request) -> Response:
        if request.method == "POST":
            db.fault = await request.json()
            for queue in db.listeners:
                if db.fault.get("cancel"):
                    queue.put_nowait(("cancel", "Permission denied"))
                if db.fault.get("cancel") or db.fault.get("cut"):
                    queue.put_nowait(None)
        return JSONResponse(
            {
                "requests": db.requests,
                "at_once": db.at_once,
                "streams": len(db.listeners),
                "bytes": db.bytes,
                "tree": db.tree,
            }
        )

    async def rest(request: Request) -> Response:
        db.requests[request.method] += 1
        db.now_at_once += 1
        db.at_once = max(db.at_once, db.now_at_once)
        try:
            return await answer(request)
        finally:
            db.now_at_once -= 1

    async def answer(request: Request) -> Response:
        while db.fault.get("hang"):
            if await request.is_disconnected():
                return Response(status_code=499)
            await asyncio.sleep(0.02)
        if db.fault.get("answer"):
            return JSONResponse({"error": "as the test asked"}, db.fault["answer"], HEADERS)
        if not request.url.path.endswith(".json"):
            return JSONResponse({"error": "no .json"}, 404, HEADERS)
        path = _path(request.url.path.removesuffix(".json"))
        writes = request.method != "GET"
        owner = request.headers.get("authorization") == "Bearer owner"
        if not owner and not db.allows(".write" if writes else ".read", path):
            return JSONResponse({"error": "Permission denied"}, 401, HEADERS)
        if writes:
            return await write(request, path)
        if "text/event-stream" in request.headers.get("accept", ""):
            return StreamingResponse(stream(path), media_type="text/event-stream", headers=HEADERS)
        found = db.at(path)
        if request.query_params.get("shallow") == "true" and isinstance(found, dict):
            found = dict.fromkeys(found, True)
        return JSONResponse(found, headers=HEADERS)

    async def write(request: Request, path: Path_) -> Response:
        raw = await request.body()
        db.bytes += len(raw)
        try:
            value = json.loads(raw) if raw else None
        except ValueError:
            return JSONResponse({"error": "Invalid data; couldn't parse JSON object."}, 400, HEADERS)
        if request.method == "PATCH":
            if not isinstance(value, dict):
                return JSONResponse({"error": "Invalid data; couldn't parse JSON object."}, 400, HEADERS)
            changed = {_path(below): child for below, child in value.items()}
            if any(a != b and b[: len(a)] == a for a in changed for b in changed):
                return JSONResponse({"error": "Path is ancestor of another path in update"}, 400, HEADERS)
            for below, child in changed.items():
                db.put((*path, *below), child)
            db.tell(path, changed)
        else:
            value = None if request.method == "DELETE" else value
            db.put(path, value)
            db.tell(path, None)
        if request.query_params.get("print") == "silent":
            return Response(status_code=204, headers=HEADERS)
        return JSONResponse(value, headers=HEADERS)

    async def stream(path: Path_) -> AsyncIterator[str]:
        queue: asyncio.Queue[tuple[str, Any] | None] = asyncio.Queue()
        db.listeners[queue] = path
        try:
            yield _sse("put", {"path": "/", "data": db.at(path)})
            while True:
                try:
                    said = await asyncio.wait_for(queue.get(), KEEP_ALIVE_S)
                except TimeoutError:
                    yield _sse("keep-alive", None)
                    continue
                if said is None:
                    return
                yield _sse(*said)
        finally:
            del db.listeners[queue]

    methods = ["GET", "PUT", "PATCH", "DELETE"]
    return Starlette(
        routes=[
            Route("/.double", control, methods=["GET", "POST"]),
            Route("/{_:path}", rest, methods=methods),
        ]
    )


def _sse(name: str, data: Any) -> str:
    return f"event: {name}\ndata: {json.dumps(data, separators=(',', ':'))}\n\n"


class _Server(uvicorn.Server):
    async def startup(self, sockets: Any = None) -> None:
        await super().startup(sockets)
        host, port = self.servers[0].sockets[0].getsockname()[:2]
        print(f"http://{host}:{port}", flush=True)


class Double:
    """One in a process of its own, with our rules, for tests."""

    def __init__(self) -> None:
        command = [sys.executable, __file__, str(RULES)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().strip()
        assert self.url.startswith("http://127.0.0.1:")

    def says(self) -> dict[str, Any]:
        """What was asked of it."""
        found: dict[str, Any] = httpx.get(f"{self.url}/.double", trust_env=False).json()
        return found

    def becomes(self, **fault: object) -> None:
        """From now on."""
        httpx.post(f"{self.url}/.double", json=fault, trust_env=False)

    def node(self, robot: str = "r") -> dict[str, Any] | None:
        """As anyone may read it."""
        answer = httpx.get(f"{self.url}/posecast/{robot}.json", trust_env=False)
        assert answer.status_code == 200
        found: dict[str, Any] | None = answer.json()
        return found

    def stop(self) -> None:
        """End it."""
        self.process.terminate()
        self.process.wait(10)


def main(arguments: list[str]) -> None:
    """Until it is ended."""
    rules = json.loads(Path(arguments[0]).read_text()) if arguments else None
    config = uvicorn.Config(
        make_app(Database(rules)), host="127.0.0.1", port=0, log_level="warning", timeout_graceful_shutdown=1
    )
    _Server(config).run()


if __name__ == "__main__":
    main(sys.argv[1:])
