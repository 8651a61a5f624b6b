"""`posecast.Robot`: puts a Python program's robot on a URL, without a separate agent process."""

from __future__ import annotations

import logging
import os
import weakref
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import NoReturn, Protocol, TypeVar

from posecast_wire.keys import check_name
from posecast_wire.schema import CHANNELS_MAX, FIELD_NAME

from posecast_edge import kit
from posecast_edge.agent import Agent, AgentSettings
from posecast_edge.background_agent import BackgroundAgent, NoProgressLine
from posecast_edge.kit import quote
from posecast_edge.model.robot_file import find_format
from posecast_edge.model.serve.background import BackgroundBuild
from posecast_edge.model.serve.bundle import Bundle, ModelError, load_built, load_bundle
from posecast_edge.model.urdf.resolver import list_package_folders
from posecast_edge.profile.defaults import JOINT_FIELDS
from posecast_edge.profile.reader import find_profile, load_profile
from posecast_edge.profile.types import Profile
from posecast_edge.sample import NOTHING
from posecast_edge.sources.clock import StepCheck, explain_time, read_time
from posecast_edge.sources.published.checks import ProblemList
from posecast_edge.sources.published.readings import (
    SHOWN,
    Copied,
    PublishedSlot,
    ReadingsCopier,
    UnusableError,
    copy_base,
)
from posecast_edge.sources.published.source import OF_PROFILE, PublishedSource
from posecast_edge.uplink.credentials import read_credential
from posecast_edge.uplink.route import check_endpoint, check_server_name, make_route, parse_proxy

log = logging.getLogger("posecast_edge.robot")

KEY_INTERVAL_S = 4.0
INFO_MAX = 32  # texts per call
INFO_CHARS = 200
MEANT = {  # common name → the name that the page knows
    "position": "pos",
    "q": "pos",
    "velocity": "vel",
    "torque": "effort",
    "tau": "effort",
    "current": "cur",
    "temperature": "temp",
    "force": "ftf",
    "quaternion": "quat",
    "acceleration": "acc",
}

T_co = TypeVar("T_co", covariant=True)


class Array(Protocol[T_co]):
    """What the arrays of NumPy, PyTorch and JAX have in common."""

    @property
    def shape(self) -> tuple[int, ...]:
        """The length along each axis."""

    def __len__(self) -> int:
        """The length along the first axis."""

    def tolist(self) -> T_co:
        """The values as Python numbers or nested lists."""


Numbers = Sequence[float | None] | Array[object]
ByName = Mapping[str, float | None]
JointNumbers = ByName | Numbers
BySite = Mapping[str, float | Numbers | None]
Bits = Mapping[str, int | Iterable[str] | None] | Sequence[int | Iterable[str] | None]


@dataclass(frozen=True)
class RobotStatus:
    """The state of a robot. `link`: "on air", "no link: …", "no relay", "refused", "waiting", "late" or
    "closed"; `published`: number of publish() calls; `frames`: number of frames sent to the relay;
    `problems`: each problem with the published values, and how often it occurred."""

    link: str
    published: int
    frames: int
    problems: Mapping[str, int] = field(default_factory=dict)


class Robot:
    """A robot on a relay. It sends from a background thread until close(), the end of the `with` block or the
    end of the program. All methods may be called from any thread."""

    def __init__(
        self,
        name: str,
        *,
        relay: str,
        urdf: str | os.PathLike[str] | None = None,
        model: str | os.PathLike[str] | None = None,
        profile: str | os.PathLike[str] | None = None,
        credential: str | os.PathLike[str] | None = None,
        joints: Sequence[str] | None = None,
        hz: float = 30.0,
        relay_name: str | None = None,
        proxy: str | None = None,
    ) -> None:
        """`name`: the robot's name in the link, a-z, 0-9 and -. `relay`: the relay's address,
        `tls/HOST:PORT`, or `tcp/127.0.0.1:PORT` on the same machine. `urdf`: the file of the robot's model,
        made smaller in the background; `model`: instead of `urdf`, the folder that `posecast-edge model
        build` wrote. `profile`: a TOML file, or the name of a built-in profile. `credential`: the file with
        the line that `posecast-relay robots add` printed. `joints`: joint names, in the order of your lists
        and arrays. `hz`: the highest frame rate, 1 to 60. `relay_name`: the name in the relay's certificate,
        if `relay` has another. `proxy`: connect through this HTTP proxy, http://HOST:PORT; default: the
        environment's HTTPS_PROXY, unless NO_PROXY names the relay.

        Raises ValueError (one line) for an unusable argument, and RuntimeError in a process forked from one
        that had a Robot. An unreachable relay is no error: the link comes up once the relay does.
        """
        _check_name(name)
        checked_hz = _check_hz(hz)
        endpoint = _checked("relay", relay, check_endpoint)
        server_name = None if relay_name is None else _checked("relay_name", relay_name, check_server_name)
        through = None if proxy is None else _checked("proxy", proxy, parse_proxy)
        route = make_route(endpoint, server_name, through, os.environ)
        secret = _checked("credential", credential, read_credential) if credential is not None else None
        if secret is not None and secret.robot != name:
            raise ValueError(f"credential: it is for robot {secret.robot!r}, not for {name!r}")
        if urdf is not None and model is not None:
            raise ValueError("urdf and model: give one, not both")
        found = None if profile is None else _load_profile(profile)
        own = _check_joints(joints, found)
        built, raw = _load_model(urdf, model)

        self._problems = ProblemList()
        self._steps = StepCheck(self._problems.add)
        self._slot = PublishedSlot()
        source = PublishedSource(self._slot, own, found, self._problems)
        settings = AgentSettings(name, route, checked_hz, KEY_INTERVAL_S, secret)
        agent = Agent(settings, source, found, NoProgressLine(), self._problems.add)

        def take_model(bundle: Bundle) -> None:
            agent.set_model(bundle)
            source.expect_model(bundle)

        build = None
        if built is not None:
            take_model(built)
        elif urdf is not None:
            if raw is not None:
                agent.expect_model(raw)  # building the model may take a minute
                source.expect_model(raw)
            build = BackgroundBuild(Path(urdf), raw, take_model)
        orders = {f.name: f.labels for f in found.fields} if found else {}
        orders |= dict.fromkeys(JOINT_FIELDS, own) if own else {}
        bit_fields = [f.name for f in found.fields if f.bits] if found else ["flags", "diag"]
        self._own_fields = frozenset(f.name for f in found.fields) if found else frozenset()
        self._copier = ReadingsCopier(orders, bit_fields, self._problems.add)
        self._closed = False
        self._background = BackgroundAgent(agent, source, build)
        self._background.start()
        weakref.finalize(self, self._background.abandon).atexit = False

    def publish(
        self,
        *wrong: NoReturn,  # a type checker refuses positional arguments; at run time they are reported
        t: float | None = None,
        pos: JointNumbers | None = None,
        ref: JointNumbers | None = None,
        vel: JointNumbers | None = None,
        effort: JointNumbers | None = None,
        cur: JointNumbers | None = None,
        temp: JointNumbers | None = None,
        duty: JointNumbers | None = None,
        heat: JointNumbers | None = None,
        flags: Bits | None = None,
        base: Numbers | None = None,
        ftf: BySite | None = None,
        ftm: BySite | None = None,
        quat: BySite | None = None,
        gyro: BySite | None = None,
        acc: BySite | None = None,
        tilt: ByName | None = None,
        volt: ByName | None = None,
        amp: ByName | None = None,
        watt: ByName | None = None,
        charge: ByName | None = None,
        diag: Bits | None = None,
        info: Mapping[str, str | float] | None = None,
        **others: JointNumbers | None,
    ) -> None:
        """Publish the robot's current readings. Returns within microseconds, never blocks and never raises:
        each problem is logged once and counted in status().

        Joints, as {name: value} or, with joints=[…], as a list or array in that order: `pos` and `ref` (rad
        or m), `vel` (rad/s or m/s), `effort` (N·m or N), `cur` (A), `temp` (°C), `duty` (%), `heat` (J),
        `flags` (names of bits, or a mask). `base`: pose of the root link, x, y, z (m) and a quaternion
        x, y, z, w. Sensors, as {site: value}: `ftf` (N), `ftm` (N·m), `quat` (x, y, z, w), `gyro` (rad/s),
        `acc` (m/s²), `tilt` (rad), `volt`, `amp`, `watt`, `charge` (%). `diag`: {part: bits}; `info`:
        {name: text}. Any other name becomes a plain table. `t`: the robot's clock, seconds; default: the
        time of the call.

        Readings that a call leaves out keep their last value: for 1.5 s if they describe motion, otherwise
        for 60 s. None and NaN mean "no reading".
        """
        given = {
            "pos": pos,
            "ref": ref,
            "vel": vel,
            "effort": effort,
            "cur": cur,
            "temp": temp,
            "duty": duty,
            "heat": heat,
            "flags": flags,
            "ftf": ftf,
            "ftm": ftm,
            "quat": quat,
            "gyro": gyro,
            "acc": acc,
            "tilt": tilt,
            "volt": volt,
            "amp": amp,
            "watt": watt,
            "charge": charge,
            "diag": diag,
            "base": base,
        }
        try:
            if self._closed or self._background.is_fork():
                self._report_unheard()
                return
            now_s = kit.now_s()
            if wrong:
                self._problems.add("publish() takes keyword arguments only: publish(pos=…)")
            copies: list[Copied] = []
            for name, readings in given.items():
                if readings is not None:
                    self._copy(name, readings, copies)
            if others:
                self._copy_others(others, copies)
            texts = NOTHING if info is None else self._copy_info(info)
            t_s = now_s if t is None else self._read_time(t, copies, now_s)
            if copies or texts:
                self._slot.put(t_s, copies, texts, now_s)
        except Exception as e:  # the program may control a robot: never let an exception reach it
            self._problems.add(f"publish() failed: {type(e).__name__}")

    def status(self) -> RobotStatus:
        """The robot's state. Never blocks."""
        return RobotStatus(
            "closed" if self._closed else self._background.describe_link(),
            self._slot.published,
            self._background.frames,
            self._problems.get_counts(),
        )

    def close(self) -> None:
        """Send the newest readings if the link is up, then stop. Takes about a second at most. May be called
        more than once."""
        self._closed = True
        self._background.close()

    def __enter__(self) -> Robot:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _read_time(self, t: object, copies: Sequence[Copied], now_s: float) -> float:
        """The robot's time, seconds; what is wrong with it is reported."""
        t_s = read_time(t)
        if t_s is None or t_s != t:
            remark = explain_time(t, lambda t: quote(t, SHOWN))
            if remark:
                self._problems.add(remark, "t" if t_s is None else "unit of t")
        if t_s is None:
            return now_s
        self._steps.check_step(tuple(copied.name for copied in copies), t_s)
        return t_s

    def _is_sent(self, name: str) -> bool:
        """Whether the robot may have this field. If not, that is reported, and nothing about its values."""
        if not self._own_fields or name in self._own_fields:
            return True
        hint = f"; did you mean {MEANT[name]}=?" if MEANT.get(name) in self._own_fields else ""
        self._problems.add(f"{name} is left out: {OF_PROFILE}{hint}")
        return False

    def _copy(self, name: str, readings: object, copies: list[Copied]) -> None:
        try:
            if name == "base":
                copies += [copied for copied in copy_base(readings) if self._is_sent(copied.name)]
            elif self._is_sent(name):
                copies.append(self._copier.copy_field(name, readings))
        except UnusableError as e:
            self._problems.add(str(e))
        except Exception as e:  # keep the other fields
            self._problems.add(f"{name} can't be read: {type(e).__name__}")

    def _copy_others(self, others: Mapping[str, object], copies: list[Copied]) -> None:
        for name, readings in islice(others.items(), CHANNELS_MAX):
            if not FIELD_NAME.fullmatch(name) or name == "baseq":
                self._problems.add(f"{quote(name)} is not a field name")
                continue
            if name in MEANT and not self._own_fields:
                self._problems.add(f"{name} becomes a plain table; did you mean {MEANT[name]}=?")
            if readings is not None:
                self._copy(name, readings, copies)

    def _copy_info(self, info: object) -> dict[str, str]:
        texts: dict[str, str] = {}
        if not isinstance(info, Mapping):
            self._problems.add("info is not a dict of texts")
            return texts
        try:
            for name, text in islice(info.items(), INFO_MAX + 1):
                if len(texts) == INFO_MAX:
                    self._problems.add(f"info has more than {INFO_MAX} entries")
                elif isinstance(name, str) and isinstance(text, (str, int, float)):
                    texts[name[:INFO_CHARS]] = _print(text)
                else:
                    self._problems.add(f"info {quote(name)} is not a text")
        except Exception as e:  # another thread changed it: keep the rest of the call
            self._problems.add(f"info can't be read: {type(e).__name__}")
        return texts

    def _report_unheard(self) -> None:
        """Log it here: the thread that logs problems is gone."""
        text = "publish() after close() has no effect"
        if not self._closed:
            text = "publish() has no effect in a fork of the process that has the Robot"
        self._problems.add(text)
        self._problems.log_new()


def _print(text: object) -> str:
    try:
        return str(text)[:INFO_CHARS]
    except ValueError:  # an integer of more than 4300 digits
        return quote(text)


def _check_name(name: object) -> None:
    if not isinstance(name, str):
        raise ValueError(f"name: {quote(name)} is not a string")
    check_name("robot", name)


def _check_hz(hz: object) -> float:
    if isinstance(hz, bool) or not isinstance(hz, (int, float)) or not 1 <= hz <= 60:
        raise ValueError(f"hz: {quote(hz)} is not a number from 1 to 60")
    return float(hz)


_T = TypeVar("_T")


class _Check(Protocol[T_co]):
    def __call__(self, text: str, /) -> T_co: ...


def _checked(argument: str, given: object, check: _Check[_T]) -> _T:
    try:
        return check(os.fspath(given))  # type: ignore[call-overload]
    except TypeError:
        raise ValueError(f"{argument}: {quote(given)} is not a string") from None
    except ValueError as e:
        raise ValueError(f"{argument}: {e}") from None


def _load_profile(given: object) -> Profile:
    return _checked("profile", given, lambda text: load_profile(find_profile(text)))


def _check_joints(joints: object, profile: Profile | None) -> tuple[str, ...]:
    if joints is None:
        return ()
    if isinstance(joints, (str, bytes)) or not isinstance(joints, Iterable):
        raise ValueError(f"joints: {quote(joints)} is not a list of names")
    names = tuple(islice(joints, CHANNELS_MAX + 1))
    for name in names:
        if not isinstance(name, str) or not name:
            raise ValueError(f"joints: {quote(name)} is not a name")
        if names.count(name) > 1 and len(names) != len(set(names)):
            raise ValueError(f"joints: {quote(name)} is listed twice")
    if not 0 < len(names) <= CHANNELS_MAX:
        raise ValueError(f"joints: give 1 to {CHANNELS_MAX} names")
    if profile is not None:
        known = {label for f in profile.fields if f.name in JOINT_FIELDS for label in f.labels}
        for name in names:
            if name not in known:
                raise ValueError(f"joints: the profile has no joint {quote(name)}")
    return names


def _load_model(urdf: object, model: object) -> tuple[Bundle | None, Bundle | None]:
    """(built, raw): at most one of them is not None."""
    try:
        if model is not None:
            return _checked("model", model, lambda text: load_built(Path(text))), None
        if urdf is None:
            return None, None
        packages = list_package_folders(os.environ)
        # the page reads URDF only; a model in another format is sent once it has been built
        is_urdf = _checked("urdf", urdf, lambda text: find_format(Path(text)) == "urdf")
        raw = _checked("urdf", urdf, lambda text: load_bundle(Path(text), packages)) if is_urdf else None
    except ModelError as e:
        raise ValueError(f"{'urdf' if model is None else 'model'}: {e}") from None
    return None, raw
