"""`posecast-edge`: the command beside the robot."""

from __future__ import annotations

import logging
import os
import signal
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, NoReturn

from posecast_wire.schema import SchemaError

from posecast_edge.console import Console
from posecast_edge.model.bundle import ModelError, load_built, load_bundle
from posecast_edge.model.resolve import package_folders
from posecast_edge.profile_reader import ProfileError, load_profile
from posecast_edge.settings import Settings, UsageError, parse_settings
from posecast_edge.sources import Discovering, SourceError, defaults_of, open_source

if TYPE_CHECKING:
    from posecast_edge.model.background import BackgroundBuild
    from posecast_edge.model.described import DescribedModel

WRONG_CONFIGURATION = 2


def main() -> NoReturn:
    """Entry point; ends the process."""
    if sys.argv[1:2] in (["model"], ["doctor"]):
        from posecast_edge.model.command import run_command  # noqa: PLC0415 - `run` stays small without it

        _leave(run_command(sys.argv[1:], os.environ))
    if sys.argv[1:2] == ["probe"]:
        from posecast_edge.probe import run_probe  # noqa: PLC0415

        _leave(run_probe(sys.argv[2:]))
    if sys.argv[1:2] == ["profile"]:
        from posecast_edge.profile_new import run_profile  # noqa: PLC0415

        _leave(run_profile(sys.argv[2:]))
    console = Console()
    log = logging.getLogger("posecast_edge")
    log.addHandler(console)
    log.setLevel(logging.INFO)
    try:
        settings = parse_settings(sys.argv[1:], os.environ)
        status = _run(settings, console)
    except (UsageError, ProfileError, ModelError, SourceError, SchemaError) as e:
        log.error("%s", e)
        status = WRONG_CONFIGURATION
    except KeyboardInterrupt:  # before the handlers stand
        status = 0
    _leave(status)


def _leave(status: int) -> NoReturn:
    """Ends the process as it is: the interpreter's own farewell waits for a thread that sits in an open() of
    the link, and one of Zenoh's threads that calls into it meanwhile aborts the process."""
    with suppress(BrokenPipeError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(status)


def _run(settings: Settings, console: Console) -> int:
    defaults = defaults_of(settings.source)
    profile_path = settings.profile or defaults.profile
    urdf = settings.urdf or defaults.urdf
    model = settings.model or (None if settings.urdf else defaults.model)
    profile = load_profile(profile_path) if profile_path else None
    built = load_built(model) if model else None
    raw = load_bundle(urdf, package_folders(os.environ)) if urdf and not built else None
    if raw:
        raw.tell_missing()
    source = open_source(settings.source, profile)

    from posecast_edge.agent import Agent  # noqa: PLC0415 - Zenoh costs time and memory a wrong flag need not pay

    agent = Agent(settings, source, profile, console)
    if built:
        agent.offer(built)
    build: BackgroundBuild | DescribedModel | None = None
    if urdf and raw:
        from posecast_edge.model.background import BackgroundBuild  # noqa: PLC0415 - the same

        build = BackgroundBuild(urdf, raw, agent.offer)
    elif isinstance(source, Discovering) and not built:
        from posecast_edge.model.described import DescribedModel  # noqa: PLC0415 - the same

        build = DescribedModel(package_folders(os.environ), agent.offer)
        source.describe_to(build.take)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: agent.stop())
    if build:
        build.start()
    try:
        return agent.run()
    finally:
        if build:
            build.stop()
