"""docs/how-to/operate/back-up.md, followed step by step: lost data comes back, and deleted data is deleted
again."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import BIN
from tests.doc_blocks.block import read_blocks

FOLDER, BACKUP, SAVE, RESTORE, DELETE = read_blocks("docs/how-to/operate/back-up.md", "sh")
NAME = "1795357260112-1795357264123-8f14e45fceea167b-{index}-7-a.segment"  # a moment of the deletion's span
KEPT = NAME.format(index=1).replace("17953", "17952")  # and one of the day before

pytestmark = pytest.mark.skipif(shutil.which("rsync") is None, reason="no rsync here")
Do = Callable[[str], None]


@pytest.fixture
def do(tmp_path: Path) -> Do:
    """Run a block of the page, with the folders of this test and as its user."""
    (tmp_path / "relay").mkdir()
    (tmp_path / "relay/robots.toml").touch(0o600)

    def carry_out(block: str) -> None:
        script = block.replace("posecast-relay:posecast-relay", f"{os.getuid()}:{os.getgid()}")
        script = script.replace("runuser -u posecast-relay -- /opt/posecast/bin", f"{BIN}")
        script = re.sub(r"past delete\b", "past delete --yes", script)
        script = script.replace("/srv/posecast", f"{tmp_path}/disk").replace("/backup", f"{tmp_path}/backup")
        script = script.replace("/var/lib/posecast-relay", f"{tmp_path}/relay")
        done = subprocess.run(
            ["bash", "-euc", script], capture_output=True, text=True, timeout=60, check=False
        )
        assert (done.returncode, done.stderr) == (0, ""), script

    return carry_out


def mounted(block: str) -> str:
    """As on a machine where the disk is mounted."""
    return block.replace("mountpoint -q /srv/posecast", "true")


def fill(store: Path) -> None:
    """Two segments in a store: one in an hour that the page deletes, and one a day before."""
    for folder, name in (("2026-11-22/14-20", NAME.format(index=12)), ("2026-11-21/10-30", KEPT)):
        (store / "hubo/public" / folder).mkdir(parents=True)
        (store / "hubo/public" / folder / name).write_bytes(b"segment")


def names(store: Path) -> list[str]:
    """All segments of a store."""
    return sorted(path.name for path in store.rglob("*.segment"))


@pytest.mark.parametrize("loses_tombstones", [False, True])
def test_a_restore_brings_back_what_is_lost_and_deletes_again(
    do: Do, tmp_path: Path, loses_tombstones: bool
) -> None:
    store = tmp_path / "disk/past"
    fill(store)
    do(FOLDER)
    assert (tmp_path / "backup/posecast").stat().st_mode & 0o777 == 0o700
    for _ in range(2):  # each night
        do(mounted(BACKUP))
    assert len(names(tmp_path / "backup/posecast/past")) == 2
    do(DELETE)  # after the copy was made
    assert names(store) == [KEPT]
    (order,) = (store / "tombstones/hubo").iterdir()
    order.with_suffix(".done").touch()  # as a relay does a minute later

    shutil.rmtree(tmp_path / "disk" if loses_tombstones else store / "hubo")
    do(SAVE)
    do(RESTORE)
    assert len(names(store)) == 2
    tombstones = [path.name for path in store.rglob("tombstones/hubo/*")]
    assert tombstones == ([] if loses_tombstones else [order.name])
    do(DELETE)
    assert names(store) == [KEPT]


def test_a_disk_that_is_not_mounted_does_not_empty_the_copy(do: Do, tmp_path: Path) -> None:
    store = tmp_path / "disk/past"
    fill(store)
    do(FOLDER)
    do(mounted(BACKUP))
    shutil.rmtree(store)
    store.mkdir()
    do(BACKUP)
    assert len(names(tmp_path / "backup/posecast/past")) == 2
