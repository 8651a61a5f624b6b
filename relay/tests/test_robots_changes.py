"""What a command makes of the file's text, however its author has written it."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime

import pytest
from posecast_relay.config.robots_changes import RobotsDocument
from posecast_relay.config.robots_reader import Robots, RobotsError, parse_robots
from posecast_relay.core.policy import Audience

SECRET = "C" * 43
FORMS = {
    "tables": f'[robots.a]\nsecret = "{SECRET}"\n[robots.a.link]\nview = "staff"\n[robots.b]\n',
    "tables apart": f'[robots.a]\nsecret = "{SECRET}"\n[admin]\nsecret = "{SECRET}"\n[robots.b]\n'
    '[robots.a.link]\nview = "staff"\n',
    "inline": f'robots = {{ a = {{ secret = "{SECRET}", link = {{ view = "staff" }} }}, b = {{}} }}\n',
    "inline in a table": f'[robots]\na = {{ secret = "{SECRET}", link = {{ view = "staff" }} }}\nb = {{}}\n',
    "dotted": f'robots.a.secret = "{SECRET}"\nrobots.a.link.view = "staff"\nrobots.b = {{}}\n',
    "dotted in a table": f'[robots]\na.secret = "{SECRET}"\na.link.view = "staff"\nb = {{}}\n',
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_toml_can_be_changed(form: str) -> None:
    text = FORMS[form]

    def change(call: Callable[[RobotsDocument], object]) -> Robots:
        nonlocal text
        doc = RobotsDocument(text, "robots.toml")
        call(doc)
        text = doc.make_text()
        return parse_robots(text)

    began = parse_robots(text)
    assert began.enrolled["a"].rules[Audience.LINK].view == "staff"
    until = datetime(2030, 1, 1, tzinfo=UTC)
    robots = change(lambda doc: doc.add_robot("c", is_private=False, expires=until, ca=None))
    assert robots.enrolled["c"].rules[Audience.ANYONE].view == "public"
    robots = change(lambda doc: doc.set_rules("a", None, {Audience.ANYONE: ["hz=10", "view=slow"]}))
    assert (robots.enrolled["a"].rules[Audience.ANYONE].hz, robots.enrolled["a"].secret) == (10.0, SECRET)
    assert robots.enrolled["a"].rules[Audience.LINK].view == "staff"
    robots = change(lambda doc: doc.make_share_link("a", until))
    assert robots.enrolled["a"].link_key is not None
    robots = change(lambda doc: doc.set_admin_secret(["10.0.0.0/8"]))
    assert robots.admin is not None
    robots = change(lambda doc: doc.remove_robot("a"))
    assert (set(robots.enrolled), robots.enrolled["b"]) == ({"b", "c"}, began.enrolled["b"])


def test_a_file_that_is_wrong_already_is_named() -> None:
    with pytest.raises(RobotsError) as error:
        RobotsDocument("[robots.a]\nx = 1\n[robots.b]\ny = 1\n", "robots.toml")
    assert len(error.value.mistakes) == 2
    assert all(mistake.startswith("robots.toml: [robots.") for mistake in error.value.mistakes)


def test_a_field_taken_out_shows_nothing_to_whoever_saw_nothing() -> None:
    doc = RobotsDocument("[robots.a]\n", "robots.toml")
    doc.set_rules("a", None, {Audience.ANYONE: ["delay_s=", "view="]})
    assert parse_robots(doc.make_text()).enrolled["a"].rules == {}
