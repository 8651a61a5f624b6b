"""docs/reference/settings.md has every setting with its default, and pages for operators name no other."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from posecast_relay.config.settings import FLAGS
from posecast_relay.core.hub import FORGET_FULL_S
from posecast_relay.core.limits import Limits

from .operator_pages import DOCS, PAGES

PAGE = (DOCS / "reference/settings.md").read_text(encoding="utf-8")
FLAG = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
RELAY = {flag.option for flag in FLAGS} | {"--help"}
COMMANDS = {  # of `posecast-relay robots` and `past`
    *("--all", "--anyone", "--begin", "--ca", "--certificate", "--days", "--finish", "--from", "--keep"),
    *("--link", "--networks", "--private", "--signed-in", "--to", "--url", "--view", "--yes"),
}
EDGE = {"--credential", "--hz", "--relay", "--robot", "--source", "--tls-ca", "--tls-cert", "--tls-key"}
REDIS_CLI = {"--latency", "--pattern", "--scan"}
OTHERS = {  # docker, docker compose, kubectl, gcloud, rsync and tar
    *("--cap-drop", "--cert", "--delete", "--detach", "--env-file", "--exclude", "--format", "--from-file"),
    *("--force", "--from-literal", "--interactive", "--key", "--name", "--network", "--no-deps"),
    *(
        "--no-recreate",
        "--no-start",
        "--numeric-owner",
        "--profile",
        "--project-name",
        "--quiet",
        "--raw",
        "--read-only",
    ),
    *("--region", "--restart", "--rm", "--scale", "--security-opt", "--tail", "--target", "--tmpfs"),
    *("--user", "--volume", "--volumes", "--wait"),
}


def test_every_setting_has_a_row_with_its_default() -> None:
    rows = re.findall(r"^\| `(--[a-z-]+)(?: (\S+))?` \| (\S+) \|", PAGE, re.MULTILINE)
    assert {(option, kind or None, default.strip("`")) for option, kind, default in rows} == {
        (flag.option, flag.metavar, flag.default or "–") for flag in FLAGS
    }
    assert len(rows) == len(FLAGS)


def test_robots_that_have_left_keep_their_places_as_long_as_it_says() -> None:
    (row,) = re.findall(r"^\| `--max-robots .*$", PAGE, re.MULTILINE)
    assert (Limits().forget_s, FORGET_FULL_S) == (3600, 5)
    assert "an hour after it went offline; if all places are taken, after 5 s" in row


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_flag_exists(page: Path) -> None:
    found = set(FLAG.findall(page.read_text(encoding="utf-8")))
    assert found <= RELAY | COMMANDS | EDGE | REDIS_CLI | OTHERS
