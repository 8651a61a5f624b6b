"""Decides how each topic of a ROS graph is read: from the profile's [ros], otherwise from type and name. Does
no I/O."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from posecast_edge.profile.types import RosTopics
from posecast_edge.sources.ros.messages import (
    BATTERY,
    CONTROLLER_STATE,
    DIAGNOSTICS,
    IMU,
    JOINT_STATE,
    ODOMETRY,
    STRING,
    TF,
    WRENCH,
    make_site_name,
)

# role in a profile (profile.ros.ROLES) → supported message types
TYPES_OF_ROLE: Mapping[str, tuple[str, ...]] = {
    "pos": (JOINT_STATE,),
    "ref": (JOINT_STATE, CONTROLLER_STATE),
    "imu": (IMU,),
    "wrench": (WRENCH,),
    "battery": (BATTERY,),
    "diagnostics": (DIAGNOSTICS,),
    "base": (ODOMETRY,),
    "description": (STRING,),
    "tf": (TF,),  # a profile names its frames, not its topics
}
TYPES = frozenset(name for names in TYPES_OF_ROLE.values() for name in names)

TOPIC_MAX = 255  # characters, as in ROS 2; a longer one is not read

COMMAND = re.compile(r"(?:joint_)?(?:command|cmd|desired|goal|target|reference)s?|joint_(?:ref|setpoint)s?")
STATE = re.compile(r"joint_states?")
STATIC = "static"  # in a Route's site: transforms that are published once
TF_TOPICS = {"tf": "", "tf_static": STATIC}
BATTERY_WORDS = re.compile(r"battery(?:_state)?s?|power|state|status")


@dataclass(frozen=True)
class Route:
    """How a topic is read. `site`: the sensor's site; "" to use the frame in its messages."""

    role: str
    site: str = ""


class Routes:
    """The routes of one robot's topics. `namespace`: only topics below it count, "" for all."""

    def __init__(self, given: RosTopics | None, namespace: str = "") -> None:
        self._given = (given or RosTopics()).topics
        self.base_frames = (given or RosTopics()).base_frames
        self.reads_frames = self.base_frames is not None
        self._namespace = f"/{namespace.strip('/')}" if namespace.strip("/") else ""

    def watch_frames(self) -> None:
        """Read transforms even if no profile asks for them."""
        self.reads_frames = True

    def find_route(self, topic: str, type_name: str) -> Route | None:
        """How this topic is read; None: not at all. `type_name`: short form."""
        if len(topic) > TOPIC_MAX:
            return None
        if type_name == TF:
            return self._find_frames_route(topic)
        for role, types in TYPES_OF_ROLE.items():
            if type_name in types and role in self._given:
                for pattern, site in self._given[role]:
                    if match_topic(pattern, topic):
                        return Route(role, site)
        if self._namespace and not topic.startswith(f"{self._namespace}/"):
            return None
        route = _by_name(topic[len(self._namespace) :], type_name)
        return route if route is not None and route.role not in self._given else None

    def explain_unread(self, topics: Mapping[str, str]) -> str:
        """A line if none of these topics is read as the robot's positions, although some could be: they have
        another name than `joint_states`. "" otherwise. `topics`: topic → short type."""
        routes = {t: self.find_route(t, JOINT_STATE) for t, name in topics.items() if name == JOINT_STATE}
        unread = [topic for topic, route in routes.items() if route is None]
        if "pos" in self._given or not unread or Route("pos") in routes.values():
            return ""
        text = f"no topic is called joint_states, but {unread[0]} has joint states"
        return f'{text}; to read it, in a profile: [ros] pos = ["{unread[0]}"]'

    def _find_frames_route(self, topic: str) -> Route | None:
        """The route of a topic of transforms. Robots in namespaces often share one /tf."""
        above, _, last = topic.rpartition("/")
        if not self.reads_frames or last not in TF_TOPICS:
            return None
        ours = not above or f"{above}/".startswith(f"{self._namespace}/")
        return Route("tf", TF_TOPICS[last]) if ours else None

    def list_patterns(self) -> list[tuple[str, str]]:
        """(pattern, type) of every topic that may be read, for sources that can subscribe by pattern."""
        everything = f"{self._namespace}/**"
        usual = {"description": [f"{everything}/robot_description"], "base": [], "tf": []}
        if self.reads_frames:
            usual["tf"] = self.list_frame_patterns()
        found: list[tuple[str, str]] = []
        for type_name in sorted(TYPES):
            patterns: list[str] = []
            for role in (role for role, types in TYPES_OF_ROLE.items() if type_name in types):
                given = self._given.get(role)
                patterns += usual.get(role, [everything]) if given is None else [p for p, _ in given]
            whole = [everything] if everything in patterns else dict.fromkeys(patterns)
            found += [(pattern, type_name) for pattern in whole]
        return found

    def list_frame_patterns(self) -> list[str]:
        """The patterns of the topics of transforms."""
        places = (f"{self._namespace}/**", "") if self._namespace else ("/**",)
        return [f"{place}/{name}" for name in TF_TOPICS for place in places]

    def list_topics(self) -> list[tuple[str, Route]]:
        """Topics to subscribe to if the server does not list them: those that the profile names without a
        pattern, and the usual names of roles that the profile does not set."""
        given = [
            (pattern, Route(role, site))
            for role, entries in self._given.items()
            for pattern, site in entries
            if "*" not in pattern
        ]
        usual = (("pos", "joint_states"), ("description", "robot_description"))
        if self.reads_frames:
            given += [(f"/{name}", Route("tf", site)) for name, site in TF_TOPICS.items()]
        return given + [(f"{self._namespace}/{name}", Route(r)) for r, name in usual if r not in self._given]


def _by_name(topic: str, type_name: str) -> Route | None:
    last = topic.rpartition("/")[2]
    if type_name == JOINT_STATE:
        return Route("ref") if COMMAND.fullmatch(last) else Route("pos") if STATE.fullmatch(last) else None
    if type_name == BATTERY:
        words = [w for w in topic.strip("/").split("/") if not BATTERY_WORDS.fullmatch(w)]
        return Route("battery", make_site_name("_".join(words)) or "main")
    if type_name == STRING:
        return Route("description") if last == "robot_description" else None
    roles = {CONTROLLER_STATE: "ref", IMU: "imu", WRENCH: "wrench", DIAGNOSTICS: "diagnostics"}
    role = roles.get(type_name)  # odometry has many publishers and no usual name: the profile must set it
    if role == "diagnostics" and last == "diagnostics_agg":
        return None  # repeats /diagnostics
    return Route(role) if role else None


def match_topic(pattern: str, topic: str) -> bool:
    """Whether `topic` matches: `*` is any text within one part of the name, `**` any number of parts."""
    return _expression(pattern).fullmatch(topic) is not None


@lru_cache(maxsize=256)
def _expression(pattern: str) -> re.Pattern[str]:
    parts = re.split(r"(/\*\*(?=/|$)|\*)", "/" + pattern.lstrip("/"))
    meaning = {"/**": "(?:/[^/]+)*", "*": "[^/]*"}
    return re.compile("".join(meaning.get(part) or re.escape(part) for part in parts))
