"""The statements of docs/how-to/robots/show-balance.md about a robot's profile are true."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest
from posecast_edge.profile.reader import ProfileError, parse_profile
from posecast_edge.profile.schema import make_schema_text
from posecast_wire.schema import Schema, Threshold

from tests.doc_blocks.block import read_blocks

pytestmark = pytest.mark.docs

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs/how-to/robots/show-balance.md").read_text(encoding="utf-8")
WRENCHES = """
[labels]
joint = ["A"]
[[fields]]
name = "pos"
[[fields]]
name = "ftf"
unit = "{force}"
labels = ["RF.fz", "LF.fz"]
[[fields]]
name = "ftm"
unit = "{moment}"
labels = ["RF.mx", "LF.mx"]
[sensors]
RF = {{ kind = "wrench", link = "right_foot" }}
LF = {{ kind = "wrench", link = "left_foot" }}
"""


def find_units(before: str, after: str) -> list[str]:
    """The units between two words of the page."""
    [between] = re.findall(rf"{before}([^.;]*?){after}", PAGE)
    return re.findall(r"[mk]?N(?:·mm|·m)?\b", between)


READ_UNITS = """
import { runnerImport } from 'vite';

const options = { configFile: false, logLevel: 'error', root: '.' };
const { module } = await runnerImport('src/twin/wrench_units.ts', options);
const { factorAmong, FORCE_UNITS, TORQUE_UNITS } = module;
const { forces, moments } = JSON.parse(process.argv[1]);
const read = (units, factors) => units.filter((unit) => factorAmong(factors, unit) !== null);
console.log(JSON.stringify([read(forces, FORCE_UNITS), read(moments, TORQUE_UNITS)]));
"""


def list_read(forces: Sequence[str], moments: Sequence[str]) -> list[list[str]]:
    """Those of these units that the page reads."""
    asked = json.dumps({"forces": forces, "moments": moments})
    command = ["node", "--input-type=module", "-e", READ_UNITS, asked]
    done = subprocess.run(command, cwd=ROOT / "spa", capture_output=True, text=True, check=True)
    found: list[list[str]] = json.loads(done.stdout)
    return found


def test_the_example_is_a_profile() -> None:
    [example] = read_blocks("docs/how-to/robots/show-balance.md", "toml")
    text = WRENCHES.format(force="N", moment="N·m") + example
    mapping = Schema.parse(make_schema_text(parse_profile(text))).mapping
    assert (mapping.balance.feet, mapping.balance.ground) == (("RF", "LF"), "measured")
    assert mapping.find_threshold("balance", "margin") == Threshold(10, None, 0.4)


def test_a_profile_takes_the_units_that_the_page_says_and_no_other_that_is_read() -> None:
    taken = find_units("Forces and moments come in ", ", the only units")
    assert taken == ["N", "N·m"]
    parse_profile(WRENCHES.format(force=taken[0], moment=taken[1]))
    others = find_units("its own schema may also use ", "; other units")
    forces = [unit for unit in others if "·" not in unit]
    moments = [unit for unit in others if "·" in unit]
    assert (forces, moments) == (["mN", "kN"], ["mN·m", "N·mm", "kN·m"])
    assert list_read([*forces, "N", "lbf"], [*moments, "N·m", "lbf·in"]) == [
        [*forces, "N"],
        [*moments, "N·m"],
    ]
    for unit in forces:
        with pytest.raises(ProfileError, match=f"unknown unit '{unit}'"):
            parse_profile(WRENCHES.format(force=unit, moment="N·m"))
    for unit in moments:
        with pytest.raises(ProfileError, match=f"unknown unit '{unit}'"):
            parse_profile(WRENCHES.format(force="N", moment=unit))
