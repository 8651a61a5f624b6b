"""Links and who opens them."""

from __future__ import annotations

import pytest
from posecast_command.link import draw_qr, has_browser, is_for_others, name_host, name_local_host


@pytest.mark.parametrize(
    ("environment", "platform", "opens"),
    [
        ({"DISPLAY": ":0"}, "linux", True),
        ({"WAYLAND_DISPLAY": "wayland-0"}, "linux", True),
        ({}, "linux", False),
        ({}, "darwin", True),
        ({"CI": "true"}, "darwin", False),
        ({"DISPLAY": ":0", "CI": "1"}, "linux", False),
        ({"DISPLAY": "localhost:10.0", "SSH_CONNECTION": "10.0.0.1 1 10.0.0.2 22"}, "linux", False),
    ],
)
def test_a_browser_opens_where_a_person_sits(environment: dict[str, str], platform: str, opens: bool) -> None:
    assert has_browser(environment, platform) is opens


@pytest.mark.parametrize(
    ("host", "others"),
    [("127.0.0.1", False), ("localhost", False), ("::1", False), ("0.0.0.0", True), ("10.0.0.5", True)],
)
def test_the_phone_in_your_hand_gets_a_code(host: str, others: bool) -> None:
    assert is_for_others(host) is others


def test_hosts_in_links() -> None:
    assert name_host("10.0.0.5") == "10.0.0.5"
    assert name_host("::1") == "[::1]"
    assert name_host("0.0.0.0") != "0.0.0.0"
    assert (name_local_host("0.0.0.0"), name_local_host("::"), name_local_host("lab")) == (
        "127.0.0.1",
        "[::1]",
        "lab",
    )


def test_the_code_is_drawn_in_blocks_where_the_terminal_has_them() -> None:
    drawn = draw_qr("http://10.0.0.5:8080/#/r/demo", "utf-8")
    assert len(drawn.splitlines()) > 10
    assert set("▀▄█") & set(drawn)
    assert draw_qr("http://10.0.0.5:8080/#/r/demo", "ascii") == ""
