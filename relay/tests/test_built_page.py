"""Which page a relay serves when nobody names one."""

from __future__ import annotations

from pathlib import Path

from posecast_relay.config.settings import CHECKOUT, PLACES, find_page


def test_the_page_in_the_package_comes_before_that_of_the_checkout(tmp_path: Path) -> None:
    packed, built = tmp_path / "page", tmp_path / "dist"
    for folder in (packed, built):
        folder.mkdir()
    assert find_page((packed, built)) is None  # a folder alone is no page
    (built / "index.html").touch()
    assert find_page((packed, built)) == built
    (packed / "index.html").touch()
    assert find_page((packed, built)) == packed


def test_the_checkout_is_this_one() -> None:
    assert Path(__file__).resolve().parents[2] == CHECKOUT
    assert PLACES[1] == CHECKOUT / "spa/dist"
