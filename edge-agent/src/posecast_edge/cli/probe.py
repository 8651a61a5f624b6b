"""The command `posecast-edge probe SOURCE`: shows what a source delivers. Needs no profile."""

from __future__ import annotations

import io
import logging
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path

from posecast_wire.command_line.parser import CommandParser
from posecast_wire.command_line.progress_bar import show_countdown

from posecast_edge.cli.flags import limit_number
from posecast_edge.cli.source_stats import WAIT_S, WATCH_MAX_S, ChannelStats, SourceStats, observe_source
from posecast_edge.kit import make_visible
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.moving_joints import list_moving_joints
from posecast_edge.model.robot_file import load_robot_file
from posecast_edge.model.serve.bundle import find_sliding
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.profile.defaults import find_usual_unit, guess_unit
from posecast_edge.profile.reader import ProfileError, find_profile, load_profile
from posecast_edge.profile.schema import mark_sliding
from posecast_edge.profile.types import Profile
from posecast_edge.sample import SourceError
from posecast_edge.sources.base import Discovering, Source, Tabular
from posecast_edge.sources.registry import KINDS, find_defaults, open_source

log = logging.getLogger("posecast_edge")

FINE, SILENT, WRONG = 0, 1, 2
STATUSES = {
    FINE: "the source delivers",
    SILENT: "the source sent nothing, or failed",
    WRONG: "wrong arguments",
}
SHOWN = 4  # channels of a field
SHOWN_MAX = 2000  # characters; longer lines, caused by a source's names, are cut
NAME_SHOWN = 200  # characters of a joint's name
WIDTH = 100  # characters of a line of names


def run_probe(argv: Sequence[str], program: str = "posecast-edge") -> int:
    """Run the command with the arguments after `probe`. Exit status: 0 the source delivers, 1 it is silent or
    fails, 2 the arguments are wrong."""
    args = make_parser(program).parse_args(argv)
    try:
        path: Path | None = args.profile or find_defaults(args.source).profile
        profile = load_profile(path) if path else None
        urdf = load_robot_file(args.urdf).urdf if args.urdf else None
        source = open_source(args.source, profile)
    except (SourceError, ProfileError) as e:
        for line in e.lines if isinstance(e, ProfileError) else (e,):
            log.error("%s", line)
        return WRONG
    except ModelRefused as e:
        log.error("%s%s: %s", args.urdf, "" if e.line is None else f":{e.line}", e.reason)
        return WRONG
    described: list[str] = []
    if isinstance(source, Discovering):
        source.send_urdf_to(described.append)
        source.watch_frames()
        if urdf is not None:
            source.take_joints(list_moving_joints(urdf))
    try:
        with show_countdown(sys.stderr, args.seconds, f"s of {args.source}"):
            seen = observe_source(source, args.seconds, profile)
    except SourceError as e:
        log.error("%s", e)
        for line in _offers(source):
            print(make_visible(line, SHOWN_MAX))
        return SILENT
    except KeyboardInterrupt:
        return FINE
    if seen.profile is not None and profile is None:
        if urdf is not None:
            seen.profile = mark_sliding(seen.profile, find_sliding(urdf))
        elif described:
            seen.profile = _mark_described(seen.profile, described[-1])
    for line in [*describe_source(source.description, seen), *_offers(source)]:
        print(make_visible(line, SHOWN_MAX))
    return FINE if seen.samples else SILENT


def make_parser(program: str = "posecast-edge") -> CommandParser:
    """The parser of the command."""
    parser = CommandParser(
        prog=f"{program} probe",
        description="Watch a source for a few seconds and list what it delivers.",
        statuses=STATUSES,
    )
    parser.add_argument("source", help=f"KIND[:ADDRESS]; kinds: {', '.join(KINDS)}")
    parser.add_argument(
        "--seconds", type=limit_number(0, WATCH_MAX_S), default=3.0, help="how long to watch (3)"
    )
    parser.add_argument(
        "--urdf", type=Path, help="the robot's model (URDF, xacro, SDF, MJCF), to read joints from /tf"
    )
    parser.add_argument(
        "--profile", type=find_profile, help="for a source that needs a profile, such as trajectory"
    )
    return parser


def _mark_described(profile: Profile, urdf: str) -> Profile:
    """The profile with the joint units that follow from the robot's own description."""
    try:
        return mark_sliding(profile, find_sliding(read_urdf(io.BytesIO(urdf.encode()))))
    except (ModelRefused, UnicodeEncodeError):  # `run` reports the reason
        return profile


def _offers(source: Source) -> list[str]:
    if isinstance(source, Tabular):
        return ["", "columns:", *(f"  {line}" for line in source.columns)]
    if not isinstance(source, Discovering):
        return []
    return ["", "topics:", *(f"  {line}" for line in source.offers or ["none"])]


def describe_source(description: str, seen: SourceStats) -> list[str]:
    """Format the statistics of a source as lines for the user."""
    if not seen.samples:
        what = "ended without a sample" if seen.ended else f"no sample within {WAIT_S:g} s"
        return [f"{description}: {what}"]
    lines = [
        f"{description}: {seen.samples} samples in {seen.duration_s:.1f} s, {seen.rate_hz:.1f} a second, "
        f"the longest gap {seen.longest_gap_s * 1e3:.0f} ms",
        _clock(seen),
        "",
        f"{'field':8}{'channels':>9}  {'unit':18}{'lowest':>10}{'highest':>10}  moving  examples",
    ]
    for name, channels in seen.fields.items():
        lines += [_field(name, unit, of_unit) for unit, of_unit in _by_unit(name, channels, seen.profile)]
    joints = next((seen.fields[name] for name in ("pos", "ref") if name in seen.fields), {})
    if joints:
        names = " ".join(make_visible(name, NAME_SHOWN) for name in joints)
        lines += [
            "",
            *textwrap.wrap(f"joints: {names}", WIDTH, break_long_words=False, break_on_hyphens=False),
        ]
    if seen.info:
        lines += ["", *(f"{name}: {text}" for name, text in seen.info.items())]
    return lines


def _clock(seen: SourceStats) -> str:
    first, last = seen.times_s
    pace = f", {(last - first) / seen.duration_s:.4g} s a second" if seen.duration_s > 0 else ""
    back = f", stepped back {seen.steps_back} times" if seen.steps_back else ""
    return f"robot time {first:.3f} … {last:.3f} s{pace}{back}"


def _by_unit(
    name: str, channels: dict[str, ChannelStats], profile: Profile | None
) -> list[tuple[str, dict[str, ChannelStats]]]:
    """The channels of a field, grouped by unit."""
    spec = profile.find_field(name) if profile else None
    own = profile.mapping.units.get(name, {}) if profile else {}
    usual = spec.unit if spec else find_usual_unit(name)
    found: dict[str, dict[str, ChannelStats]] = {} if channels else {usual: {}}
    for label, channel in channels.items():
        found.setdefault(own.get(label, usual), {})[label] = channel
    return list(found.items())


def _field(name: str, unit_name: str, channels: dict[str, ChannelStats]) -> str:
    read = {label: c for label, c in channels.items() if c.readings}
    numbers = [c for c in read.values() if c.last is not None]
    low = f"{min(c.low for c in numbers):.4g}" if numbers else "—"
    high = f"{max(c.high for c in numbers):.4g}" if numbers else "—"
    usual = unit_name == find_usual_unit(name)
    doubt = next((d for c in numbers if usual and (d := guess_unit(name, c.largest))), None)
    unit = f"{unit_name or '—'}{f' or {doubt}?' if doubt else ''}"
    bits = sorted(set().union(*(c.bits for c in read.values())))
    if bits:
        shown = ", ".join(bits[:8])
    else:
        shown = ", ".join(f"{label} {_number(c)}" for label, c in list(channels.items())[:SHOWN])
    more = ", …" if len(channels) > SHOWN and not bits else ""
    count = f"{len(read)}/{len(channels)}" if len(read) < len(channels) else str(len(channels))
    moving = sum(c.moves for c in read.values())
    return f"{name:8}{count:>9}  {unit:18}{low:>10}{high:>10}  {moving:>6}  {shown}{more}"


def _number(channel: ChannelStats) -> str:
    return "—" if channel.last is None else f"{channel.last:.4g}"
