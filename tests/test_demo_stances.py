"""The page's text about the demo robot's balance during its minute, and with limits set by a profile."""

from __future__ import annotations

import json
from collections import Counter
from typing import Any

import pytest
from posecast_edge.profile.reader import load_profile, parse_profile
from posecast_edge.profile.schema import make_schema_text
from posecast_edge.sources.demo import PROFILE, Motion, read_motion

from tests.balance.page import REPO, encode_values, read_stances

BUNDLE = REPO / "edge-agent/src/posecast_edge/demo_bundle"
EVERY_S = 0.1  # the page tells it about so often

pytestmark = pytest.mark.skipif(not (BUNDLE / "model").is_dir(), reason="the demo robot is not built")


@pytest.fixture(scope="module")
def motion() -> Motion:
    return read_motion((BUNDLE / "motion.bin").read_bytes())


def play(motion: Motion, schema: str, first: int = 0) -> dict[str, Any]:
    """The text for the minute's moments from a sample on."""
    manifest = json.loads((BUNDLE / "model/manifest.json").read_bytes())
    labels = {f["name"]: json.loads(schema)["labels"][f["labels"]] for f in json.loads(schema)["fields"]}
    frames = []
    step = round(EVERY_S * motion.rate_hz)
    for index in range(first, motion.samples, step):
        sample = motion.make_sample(index)
        values: dict[str, float] = {
            f"{name} {label}": float(value)
            for name, row in sample.values.items()
            for label, value in zip(labels[name], row, strict=True)
            if isinstance(value, (int, float))
        }
        frames.append({"t": sample.t_s, "codes": encode_values(schema, values)})
    return read_stances(manifest, schema, frames)


# from each of the samples that the page may begin with; in `make test` from the first
@pytest.mark.parametrize("first", [0, *(pytest.param(n, marks=pytest.mark.full) for n in range(1, 6))])
def test_a_walk_is_told_as_moving_and_nothing_is_logged(motion: Motion, first: int) -> None:
    found = play(motion, make_schema_text(load_profile(PROFILE)), first)
    kinds = Counter(stance["kind"] for stance in found["stances"])
    print(dict(kinds))
    assert found["owner"] == "page"
    assert kinds["moving"] > 30
    assert kinds["outside"] == 0
    assert {stance["level"] for stance in found["stances"]} == {"ok", "caution"}
    assert found["crossings"] == []


def test_a_profiles_limit_of_the_margin_holds_on_the_page(motion: Motion) -> None:
    """From [thresholds.balance] through the schema, as the agent sends it, to text and log."""
    text = PROFILE.read_text() + "\n[thresholds.balance]\nmargin = { low = 10, caution = 0.4 }\n"
    found = play(motion, make_schema_text(parse_profile(text, "demo")))
    assert found["owner"] == "profile"
    assert found["threshold"] == {"low": 10, "high": None, "caution": 0.4}
    faults = [stance for stance in found["stances"] if stance["level"] == "fault"]
    assert len(faults) > 40
    assert {(each["side"], each["limit"], each["own"]) for each in found["crossings"]} == {
        ("below", "10 mm", False)
    }
