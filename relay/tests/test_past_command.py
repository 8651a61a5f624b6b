"""`posecast-relay past`: what it prints, asks and refuses, over a store in a folder and a relay's socket."""

from __future__ import annotations

import asyncio
import io
import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from posecast_relay.archive.store import NO_SPACE, ArchiveRefused, ObjectStore
from posecast_relay.config.settings import SettingsError
from posecast_relay.past.command_socket import PastSocket
from posecast_relay.past.deletions import Deletions
from posecast_relay.past.memory import MemoryPast
from posecast_relay.past_command.main import run_past
from posecast_relay.server.past import ObedientMemory

from .archive_world import ArchiveWorld, make_run
from .past_doors import PAGE_MS, make_kept

DAY_MS = 86_400_000


@pytest.fixture(autouse=True)
def korea(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """This machine's zone is nine hours ahead."""
    monkeypatch.setenv("TZ", "Asia/Seoul")
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


async def fill(folder: Path) -> None:
    """Two views of one robot, over midnight, one of another, and something that is not ours."""
    world = ArchiveWorld(folder, ("r", "other-robot"))
    midnight = PAGE_MS - PAGE_MS % DAY_MS + DAY_MS
    await world.write(*make_run(4, midnight - 8000), make_kept(0, PAGE_MS, view="staff"))
    await world.write(make_kept(0, PAGE_MS, robot="other-robot"))
    await world.index()
    (folder / "r" / "notes.txt").write_text("mine")


def run(*argv: str) -> None:
    """The command, with nothing in its environment."""
    run_past(argv, {})


def fail(capsys: pytest.CaptureFixture[str], *argv: str) -> str:
    """What a command that fails says: status 1, and nothing on stdout."""
    with pytest.raises(SystemExit) as ended:
        run(*argv)
    assert ended.value.code == 1
    told = capsys.readouterr()
    assert told.out == ""
    return told.err


def test_list_prints_aligned_columns(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asyncio.run(fill(tmp_path))
    store = f"file://{tmp_path}"
    run("list", "--past", store)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["robot", "view", "from", "to", "bytes", "segments"]
    assert [line.split()[:4] for line in lines[1:]] == [
        ["other-robot", "public", "2026-11-18T11:20:00Z", "2026-11-18T11:20:04Z"],
        ["r", "public", "2026-11-18T23:59:52Z", "2026-11-19T00:00:08Z"],
        ["r", "staff", "2026-11-18T11:20:00Z", "2026-11-18T11:20:04Z"],
    ]
    assert len({len(line) for line in lines}) == 1
    assert lines[2].split()[-1] == "4"
    run_past(["list", "--robot", "r", "--view", "public", "--days"], {"POSECAST_PAST": store})
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[2] for line in lines] == ["day", "2026-11-18", "2026-11-19"]
    run("list", "--past", store, "--robot", "nobody")
    assert capsys.readouterr().out == "nothing is kept of nobody\n"


def test_what_can_not_be_asked_for_so_gets_one_line(tmp_path: Path) -> None:
    store = ("--past", f"file://{tmp_path}", "--robot", "r")
    (tmp_path / "r").mkdir()
    whole = ("--from", "2026-11-18", "--to", "2026-11-19")
    for argv, why in (
        (("list", "--past", "0"), "--past 0 keeps nothing"),
        (("list", "--past", "ftp://x"), "--past 'ftp://x': use file:///FOLDER, s3://"),
        (("list", "--past", f"file://{tmp_path}/absent"), "there is no such folder"),
        (("delete", *store), "give --from and --to, or --all"),
        (("delete", *store, "--from", "2026-11-18"), "give --from and --to, or --all"),
        (("delete", *store, "--all", *whole), "give --all or --from and --to, not both"),
        (("delete", *store, *whole[2:], "--from", "2026-11-20"), "is not before"),
        (("delete", *store, "--from", "2999-01-01", "--to", "2999-01-02"), "is in the future"),
        (
            ("delete", *store, "--from", "yesterday", "--to", "2026-11-19"),
            "argument --from: 'yesterday': use",
        ),
        (("delete", "--past", f"file://{tmp_path}", "--all"), "--robot"),
        (("delete", *store[:2], "--robot", "../x", "--all"), "use 1 to 63 of a-z"),
        (("delete", *store, *whole), "can't ask for confirmation without a terminal: give --yes"),
        (("empty",), "unknown command 'empty'"),
    ):
        with pytest.raises(SettingsError) as told:
            run(*argv)
        assert why in str(told.value), argv
        assert "\n" not in str(told.value)
    assert not (tmp_path / "absent").exists()


class Keyboard(io.StringIO):
    """Somebody at a terminal."""

    def isatty(self) -> bool:
        """It is one."""
        return True


def test_it_asks_before_it_deletes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    asyncio.run(fill(tmp_path))
    span = ("--from", "2026-11-18T00:00Z", "--to", "2026-11-19T00:00Z")
    argv = ("delete", "--past", f"file://{tmp_path}", "--robot", "r", *span)
    count = len(list(tmp_path.rglob("*.segment")))
    for answer in ("", "n\n", "never\n"):
        monkeypatch.setattr(sys, "stdin", Keyboard(answer))
        asked = fail(capsys, *argv)
        assert asked.startswith(
            "r, each view, 2026-11-18T09:00:00+09:00 to 2026-11-19T09:00:00+09:00 "
            "(2026-11-18T00:00:00Z to 2026-11-19T00:00:00Z): 3 segments, "
        ), asked
        assert asked.endswith("posecast-relay: nothing was deleted\n")
    assert not (tmp_path / "tombstones").exists()
    assert len(list(tmp_path.rglob("*.segment"))) == count
    monkeypatch.setattr(sys, "stdin", Keyboard("y\n"))
    run(*argv)
    assert capsys.readouterr().out.startswith("deleted: 3 segments, ")
    assert len(list(tmp_path.rglob("*.segment"))) == count - 3
    run(*argv, "--yes")
    assert "the store had no matching segments" in capsys.readouterr().out
    assert len(list((tmp_path / "tombstones" / "r").glob("*.json"))) == 2  # memory may have had it


def test_a_store_that_does_not_let_it_in_is_one_line_and_status_1(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("ACCESS_KEY_ID", "SECRET_ACCESS_KEY"):
        monkeypatch.setenv(f"AWS_{name}", "none")
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")  # nobody is there
    told = fail(capsys, "list", "--past", "s3://bucket/lab")
    assert told.startswith("posecast-relay: the past's store: ")
    assert told.count("\n") == 1


def test_without_store_and_socket_it_says_what_to_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "give the store (--past URL)" in fail(capsys, "list")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    (tmp_path / "posecast-relay-1.sock").touch()
    assert "no relay answers at" in fail(capsys, "list")
    (tmp_path / "posecast-relay-2.sock").touch()
    assert "several relays run on this machine" in fail(capsys, "list")


async def test_strangers_at_the_socket_are_answered_or_let_go(tmp_path: Path) -> None:
    kept, deletions = MemoryPast(1 << 26), Deletions()
    ObedientMemory(kept, deletions)
    kept.add(make_kept(0, PAGE_MS), 0.0)
    path = tmp_path / "s"

    async def ask(line: bytes) -> bytes:
        reader, writer = await asyncio.open_unix_connection(str(path))
        writer.write(line)
        answer = await reader.read()
        writer.close()
        return answer

    async with PastSocket(path, kept, deletions):
        for line in (b"\n", b"{}\n", b"\xff\n", b'{"do":"delete"}\n', b'{"do":"delete","deletion":"{}"}\n'):
            assert list(json.loads(await ask(line))) == ["error"], line
        assert await ask(b"x" * 200_000) == b""
        assert len(json.loads(await ask(b'{"do":"list"}\n'))["rows"]) == 1
    assert len(kept) == 1
    assert not path.exists()


async def test_a_relay_with_a_store_deletes_nothing_from_memory_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kept, deletions = MemoryPast(1 << 26), Deletions()
    ObedientMemory(kept, deletions)
    kept.add(make_kept(0, PAGE_MS), 0.0)
    socket = ("--past-socket", str(tmp_path / "s"))
    deletion = '{"do":"delete","deletion":"{}"}\n'
    async with PastSocket(tmp_path / "s", kept, deletions, "s3://bucket/lab"):
        argv = ("delete", *socket, "--robot", "r", "--all", "--yes")
        refusal = await asyncio.to_thread(fail, capsys, *argv)
        assert refusal.startswith("posecast-relay: nothing was deleted: ")
        assert refusal.endswith("use --past s3://bucket/lab\n")
        await asyncio.to_thread(run, "list", *socket)
        told = capsys.readouterr()
        assert told.out.splitlines()[1].split()[:2] == ["r", "public"]
        assert told.err.startswith("posecast-relay: this lists only the relay's memory; ")
        assert told.err.endswith("give --past s3://bucket/lab\n")
        reader, writer = await asyncio.open_unix_connection(str(tmp_path / "s"))
        writer.write(deletion.encode())
        assert "also in a store" in json.loads(await reader.read())["error"]
        writer.close()
    assert len(kept) == 1


async def test_a_robot_that_is_nowhere_is_no_robot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    await fill(tmp_path / "store")
    argv = ("delete", "--past", f"file://{tmp_path}/store", "--all", "--yes", "--robot")
    told = await asyncio.to_thread(fail, capsys, *argv, "dmeo")
    assert told.startswith("posecast-relay: the store has no robot 'dmeo', only other-robot, r; nothing ")
    assert not (tmp_path / "store" / "tombstones").exists()
    kept = MemoryPast(1 << 26)
    kept.add(make_kept(0, PAGE_MS, robot="dmeo"), 0.0)
    async with PastSocket(tmp_path / "s", kept, Deletions(), f"file://{tmp_path}/store"):
        await asyncio.to_thread(run, *argv, "dmeo", "--past-socket", str(tmp_path / "s"))
    assert len(list((tmp_path / "store" / "tombstones" / "dmeo").glob("*.json"))) == 1


def test_on_a_full_disk_the_segments_go_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    asyncio.run(fill(tmp_path))
    put, room = ObjectStore.put, [False]

    async def refuse(self: ObjectStore, key: str, data: bytes) -> None:
        is_full = not room[0] or len(list(tmp_path.rglob("*.segment"))) > 1
        if key.startswith("tombstones") and is_full:
            raise ArchiveRefused(NO_SPACE)
        await put(self, key, data)

    monkeypatch.setattr(ObjectStore, "put", refuse)
    argv = ("delete", "--past", f"file://{tmp_path}", "--robot", "r", "--all", "--yes")
    told = fail(capsys, *argv)
    assert told.startswith("posecast-relay: deleted 5 segments from the store, but ")
    assert "(no space is left)" in told
    asyncio.run(fill(tmp_path))
    room[0] = True
    run(*argv)
    assert capsys.readouterr().out.startswith("deleted: 5 segments, ")
    assert len(list((tmp_path / "tombstones" / "r").glob("*.json"))) == 1
