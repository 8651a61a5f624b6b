"""Source `jsonl`: one JSON object per line, for programs in any language.

    {"t": 12.3, "pos": {"RKN": 0.5}, "cur": [0.1, 0.2], "flags": {"RKN": ["jam"]}, "info": {"mode": "x"}}

`jsonl` reads stdin, `jsonl:PATH` a file or FIFO (`lines.py` says how). `t` is the robot's clock in seconds,
or in smaller units if its size shows that, or the steps of a file; the default is the arrival time on the
monotonic clock. Of a line with an invalid value or text, the rest is used. If a name is repeated in one
object, its last value counts.
"""

from __future__ import annotations

import json
import math
from itertools import islice
from typing import TYPE_CHECKING, Any

from posecast_edge.kit import make_visible
from posecast_edge.sample import Sample
from posecast_edge.sources.base import Source, has_lists, split_lists
from posecast_edge.sources.clock import explain_time, read_time
from posecast_edge.sources.lines import UNIT, LineError, open_lines

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile

MAX_DIGITS = 500  # of an integer: Python's parser takes quadratic time
MAX_INFO = 32  # entries per line
MAX_INFO_CHARS = 200
NAME_SHOWN = VALUE_SHOWN = 40  # characters, in a message


def open_source(address: str, profile: Profile | None) -> Source:
    """Open stdin ("") or a path. Raises SourceError when the path can't be opened."""
    del profile  # labels are matched later, for samples of every source
    return open_lines("jsonl", address, parse_line, _find_time)


def _find_time(line: bytes) -> float:
    """The `t` of a line, in its unit; NaN if it has none (see `ReadTime`)."""
    try:
        return float(_object(line)["t"])
    except (LineError, KeyError, TypeError, ValueError, OverflowError):
        return math.nan


def parse_line(
    line: bytes, arrival_s: float, where: str = "", unit: str = "s"
) -> tuple[Sample, dict[str, str]]:
    """Parse a line (see `ParseLine`). NaN and Infinity are "no reading"."""
    value = _object(line)
    wrong: dict[str, str] = {}
    remark, t_s = "", arrival_s
    if "t" in value:
        t = value.pop("t")
        found_s = read_time(t, unit)
        if found_s is None:
            wrong["t"] = explain_time(t, _json)
        else:
            t_s, remark = found_s, explain_time(t, _json) if unit == "s" else ""
    info = _info(value.pop("info", {}), wrong)
    value = {name: values for name, values in value.items() if values is not None}  # null: no reading
    fields = {name: values for name, values in value.items() if isinstance(values, (list, dict))}
    if len(fields) < len(value):
        wrong |= {
            name: f"{make_visible(name, NAME_SHOWN)} is {_json(values)}, not a list or an object"
            for name, values in value.items()
            if name not in fields
        }
    for name, values in fields.items():
        if isinstance(values, dict) and has_lists(name, values):
            unfit: dict[str, str] = {}
            fields[name] = split_lists(name, values, unfit.__setitem__)
            wrong |= {f"{name}.{site}": text for site, text in unfit.items()}
    if not fields and not info:
        parts = wrong if wrong.keys() - {"t"} else {**wrong, "": "no field"}
        raise LineError(next(iter(parts.values())), parts)
    if remark:
        wrong[UNIT] = remark
    return Sample(t_s, fields, info, where), wrong


def _object(line: bytes) -> dict[str, Any]:
    try:
        value = json.loads(line.decode("utf-8-sig"), parse_constant=_no_reading, parse_int=_integer)
    except UnicodeDecodeError:
        raise LineError("not UTF-8") from None
    except RecursionError:
        raise LineError("nested too deep") from None
    except json.JSONDecodeError as e:
        raise LineError(f"not JSON: {e.msg} at character {e.pos + 1}") from None
    if not isinstance(value, dict):
        raise LineError("not a JSON object")
    return value


def _no_reading(_token: str) -> None:
    return None


def _integer(digits: str) -> int | float:
    return int(digits) if len(digits) <= MAX_DIGITS else float(digits)  # infinite, which is no reading


def _json(value: object) -> str:
    """The value as JSON, shortened."""
    try:
        return make_visible(json.dumps(value), VALUE_SHOWN)
    except RecursionError:
        return "nested too deep"


def _info(value: object, wrong: dict[str, str]) -> dict[str, str]:
    if not isinstance(value, dict):
        wrong["info"] = "info is not an object"
        return {}
    if len(value) > MAX_INFO:
        wrong["info"] = f"info has {len(value)} entries; at most {MAX_INFO}"
    info = {}
    for key, text in islice(value.items(), MAX_INFO):
        if isinstance(text, (str, int, float)):
            info[key[:MAX_INFO_CHARS]] = str(text)[:MAX_INFO_CHARS]
        else:
            shown = f"info.{make_visible(key, NAME_SHOWN)}"
            wrong[shown] = f"{shown} is not a text"
    return info
