"""A Redis that is a few dictionaries, for tests with a simulated clock: as much of one as relays use.

Commands travel for `delay_s` each way, are carried out one after the other, also those that nobody waits for
any more, and not while it is frozen.
"""

from __future__ import annotations

import asyncio
import fnmatch
import hashlib
from collections.abc import Callable, Sequence
from typing import Any

from posecast_relay.redis.client import RedisClient
from posecast_relay.redis.directory import BOARD
from posecast_relay.redis.scripts import CLAIM, GUARD, STATUS
from redis.exceptions import (
    AuthenticationError,
    BusyLoadingError,
    ConnectionError,
    NoScriptError,
    ReadOnlyError,
    ResponseError,
)

from .sim_redis_data import Data


class SimRedis:
    """A server, and the network between it and its clients."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.loop = loop
        self.delay_s = 0.0005
        self.clock_s = 1_800_000_000.0  # its clock less the loop's
        self.up = True
        self.lives = 1  # what was sent to an earlier one is lost
        self.frozen = False
        self.loading = False
        self.readonly = False
        self.evicting = False
        self.locked = False  # another password than the clients have
        self.data = Data(lambda: loop.time() + self.clock_s, self._publish)
        self.scripts: dict[str, str] = {}
        self.runs: dict[str, Callable[[Sequence[str], Sequence[Any]], Any]] = {
            CLAIM: self.data.claim,
            GUARD: self.data.guard,
            STATUS: self.data.status,
            BOARD: self.data.board,
        }
        self._connections: dict[Connection, None] = {}  # not a set, whose order would differ from run to run
        self._subscribers: dict[bytes, dict[PubSub, None]] = {}
        self._inbox: list[Callable[[], None]] = []

    # ---- what may happen to it --------------------------------------------

    def kill(self) -> None:
        """With all it held."""
        self.up = self.frozen = False
        self.lives += 1
        self._inbox.clear()
        self.data.flush()
        self.scripts.clear()
        self._subscribers.clear()
        for connection in tuple(self._connections):
            connection.drop()

    def start(self) -> None:
        """Empty."""
        self.up = True

    def thaw(self) -> None:
        """What was sent meanwhile is carried out now."""
        self.frozen = False
        inbox, self._inbox = self._inbox, []
        for command in inbox:
            command()

    def cut(self) -> None:
        """All connections, as when a proxy between is restarted."""
        for connection in tuple(self._connections):
            connection.drop()

    def cut_subscribers(self) -> None:
        """As Redis does to those whose buffer is full."""
        for connection in tuple(self._connections):
            if isinstance(connection, PubSub):
                connection.drop()

    def lose(self, pattern: str) -> None:
        """The keys of this pattern."""
        for key in self.data.all():
            if fnmatch.fnmatch(key.decode(), pattern):
                self.data.delete(key)

    def evict(self) -> None:
        """What was not used for longest."""
        for key in self.data.all()[:1]:
            self.data.delete(key)

    def spoil(self, pattern: str) -> None:
        """Something of another type stands under each of these keys."""
        for key in self.data.all():
            if fnmatch.fnmatch(key.decode(), pattern):
                was = self.data.value(key)
                self.data.delete(key)
                if isinstance(was, dict):
                    self.data.set(key.decode(), "odd", 1e9)
                else:
                    self.data.hset(key.decode(), "odd", "odd")

    # ---- connections ----------------------------------------------------------

    async def open(self, connection: Connection) -> None:
        """A connection is made, unless there is one."""
        if connection in self._connections:
            return
        if self.frozen:  # the kernel takes it, and the server says nothing
            await self.loop.create_future()
        if not self.up:
            raise ConnectionError("Error 111 connecting")
        if self.locked:
            raise AuthenticationError("invalid username-password pair or user is disabled.")
        self._connections[connection] = None

    def closed(self, connection: Connection) -> None:
        """By whichever side."""
        self._connections.pop(connection, None)
        for subscribers in self._subscribers.values():
            if isinstance(connection, PubSub):
                subscribers.pop(connection, None)

    def later(self, call: Callable[[], None]) -> None:
        """When it has come through the network."""
        self.loop.call_later(self.delay_s, call)

    def send(self, command: Callable[[], None]) -> None:
        """Carried out in the order in which they come, also those that nobody waits for any more."""
        life = self.lives

        def arrived() -> None:
            if self.frozen:
                self._inbox.append(command)
            elif self.up and life == self.lives:
                command()

        self.later(arrived)

    def subscribe(self, pubsub: PubSub, channel: bytes) -> None:
        """From now on."""
        if pubsub in self._connections:
            self._subscribers.setdefault(channel, {})[pubsub] = None
            pubsub.tell("ssubscribe", channel, 1)

    def unsubscribe(self, pubsub: PubSub, channel: bytes) -> None:
        """No more."""
        self._subscribers.get(channel, {}).pop(pubsub, None)
        pubsub.tell("sunsubscribe", channel, 0)

    def _publish(self, channel: bytes, message: bytes) -> None:
        for pubsub in tuple(self._subscribers.get(channel, ())):
            pubsub.tell("smessage", channel, message)

    def answer(self, name: str, args: Sequence[Any]) -> Any:
        """To one command."""
        if self.loading:
            raise BusyLoadingError("Redis is loading the dataset in memory")
        if name == "script_load":
            sha = hashlib.sha1(args[0].encode(), usedforsecurity=False).hexdigest()
            self.scripts[sha] = args[0]
            return sha
        if name == "evalsha":
            sha, count, *rest = args
            if sha not in self.scripts:
                raise NoScriptError("No matching script.")
            if self.readonly:
                raise ReadOnlyError("You can't write against a read only replica.")
            return self.runs[self.scripts[sha]](rest[:count], rest[count:])
        return getattr(self.data, name)(*args)


class Connection:
    """A client's end."""

    def __init__(self, server: SimRedis) -> None:
        self.server = server
        self._waiting: dict[asyncio.Future[Any], None] = {}

    def drop(self) -> None:
        """By the server, or on the way."""
        self.server.closed(self)
        waiting, self._waiting = self._waiting, {}
        for future in waiting:
            if not future.done():
                future.set_exception(ConnectionError("Connection closed by server."))

    async def exchange(self, commands: Sequence[tuple[str, Sequence[Any]]]) -> list[Any]:
        """Each one's answer or error."""
        server = self.server
        await server.open(self)
        future = server.loop.create_future()
        self._waiting[future] = None

        def carry_out() -> None:
            answers: list[Any] = []
            for name, args in commands:
                try:
                    answers.append(server.answer(name, args))
                except (ResponseError, ConnectionError) as e:
                    answers.append(e)
            server.later(lambda: None if future.done() else future.set_result(answers))

        server.send(carry_out)
        try:
            answers: list[Any] = await future
        finally:
            self._waiting.pop(future, None)
        for answer in answers:
            if isinstance(answer, ConnectionError):
                raise answer
        return answers


class PubSub(Connection):
    """A connection that listens."""

    def __init__(self, server: SimRedis) -> None:
        super().__init__(server)
        self._messages: asyncio.Queue[dict[str, Any] | None] = asyncio.Queue()

    def drop(self) -> None:
        """Whoever waits for a message is told."""
        super().drop()
        self._messages.put_nowait(None)

    def tell(self, kind: str, channel: bytes, data: Any) -> None:
        """When it has come through the network, if the connection stands by then."""
        message = {"type": kind, "channel": channel, "data": data}
        self.server.later(lambda: self._messages.put_nowait(message))

    async def ssubscribe(self, channel: str) -> None:
        """Confirmed by a message."""
        await self.server.open(self)
        self.server.send(lambda: self.server.subscribe(self, channel.encode()))

    async def sunsubscribe(self, channel: str) -> None:
        """Likewise."""
        self.server.send(lambda: self.server.unsubscribe(self, channel.encode()))

    async def get_message(self, timeout: float | None) -> dict[str, Any]:
        """The next one."""
        assert timeout is None
        message = await self._messages.get()
        if message is None:
            raise ConnectionError("Connection closed by server.")
        return message

    async def aclose(self) -> None:
        """By the client."""
        self.server.closed(self)


class Client:
    """As redis-py's asyncio client, with one connection."""

    def __init__(self, server: SimRedis) -> None:
        self.connection = Connection(server)
        self.connection_pool = self

    async def disconnect(self) -> None:
        """Also of the pool."""
        self.connection.drop()

    aclose = disconnect

    def pubsub(self) -> PubSub:
        """A connection of its own."""
        return PubSub(self.connection.server)

    def pipeline(self, transaction: bool) -> Pipeline:
        """Commands that travel together."""
        assert not transaction
        return Pipeline(self.connection)

    async def _ask(self, name: str, *args: Any) -> Any:
        (answer,) = await self.connection.exchange([(name, args)])
        if isinstance(answer, Exception):
            raise answer
        return answer

    async def script_load(self, text: str) -> Any:
        """Its SHA-1."""
        return await self._ask("script_load", text)

    async def evalsha(self, *args: Any) -> Any:
        """A script's answer."""
        return await self._ask("evalsha", *args)


class Pipeline:
    """Collects commands."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._commands: list[tuple[str, Sequence[Any]]] = []

    def __getattr__(self, name: str) -> Callable[..., Pipeline]:
        def collect(*args: Any) -> Pipeline:
            self._commands.append((name, args))
            return self

        return collect

    async def execute(self, raise_on_error: bool) -> list[Any]:
        """All of them."""
        assert not raise_on_error
        return await self._connection.exchange(self._commands)


class _NoLookup:
    async def find(self) -> None:
        """There are no names here."""


class SimLink(RedisClient):
    """A link to a simulated server; the URL is only for show."""

    def __init__(self, server: SimRedis) -> None:
        self._server = server
        super().__init__("redis://simulated")
        self._lookup = _NoLookup()  # type: ignore[assignment]

    def _open(self, url: str) -> Any:
        return Client(self._server)
