"""What several ask for at the same time is done once."""

from __future__ import annotations

import asyncio

import pytest
from posecast_relay.runtime.tasks import SharedTasks


async def test_those_who_ask_meanwhile_wait_for_the_same_task() -> None:
    tasks, gate, calls = SharedTasks("test"), asyncio.Event(), 0

    async def work() -> int:
        nonlocal calls
        calls += 1
        await gate.wait()
        return calls

    first, second, other = (asyncio.create_task(tasks.run(key, work)) for key in ("a", "a", "b"))
    await asyncio.sleep(0)
    assert len(tasks.list_running()) == 2
    first.cancel()  # the others go on waiting
    await asyncio.sleep(0)
    gate.set()
    assert list(await asyncio.gather(second, other)) == [2, 2]
    assert tasks.list_running() == []
    assert await tasks.run("a", work) == 3


async def test_a_failure_is_told_to_all_and_done_anew() -> None:
    tasks = SharedTasks("test")

    async def fail() -> None:
        raise ValueError("no")

    found = await asyncio.gather(*(tasks.run("a", fail) for _ in range(2)), return_exceptions=True)
    assert [str(error) for error in found] == ["no", "no"]
    assert found[0] is found[1]
    with pytest.raises(ValueError, match="no") as again:
        await tasks.run("a", fail)
    assert again.value is not found[0]
