"""`posecast-edge`: the command beside the robot."""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, NoReturn

from posecast_wire.checked import SchemaError
from posecast_wire.command_line.terminal import open_closed_streams

from posecast_edge.cli.console import Console
from posecast_edge.cli.flags import list_packages
from posecast_edge.cli.settings import Settings, UsageError, parse_settings
from posecast_edge.kit import make_visible
from posecast_edge.model.robot_file import find_format
from posecast_edge.model.serve.bundle import Bundle, ModelError, load_built, load_bundle
from posecast_edge.profile.reader import ProfileError, load_profile
from posecast_edge.sample import SourceError
from posecast_edge.sources.base import Discovering
from posecast_edge.sources.registry import find_defaults, open_source

if TYPE_CHECKING:
    from posecast_edge.model.serve.background import BackgroundBuild, DescribedModel

log = logging.getLogger("posecast_edge")

WRONG_CONFIGURATION = 2
NOT_TOLD = 1  # the output could not be written
INTERRUPTED = 130  # the shells' convention


def main(argv: Sequence[str] | None = None, program: str = "posecast-edge") -> NoReturn:
    """Entry point; ends the process. `argv`: None for the process's own arguments; `program`: its name in
    messages."""
    open_closed_streams()
    console = Console(program=program)
    # on all loggers: otherwise logging prints a library's messages with tracebacks
    logging.getLogger().addHandler(console)
    threading.excepthook = _log_thread_end
    try:
        status = _command(sys.argv[1:] if argv is None else list(argv), console, program)
        sys.stdout.flush()
    except KeyboardInterrupt:
        status = INTERRUPTED
    except BrokenPipeError:  # the reader closed the pipe
        status = NOT_TOLD
    except OSError as e:
        log.error("%s: %s", e.filename or "stdout", e.strerror or e)
        status = NOT_TOLD
    _leave(status)


def _log_thread_end(ended: threading.ExceptHookArgs) -> None:
    name = ended.thread.name if ended.thread else "?"
    log.warning(
        "thread %s ended: %s: %s", name, ended.exc_type.__name__, make_visible(str(ended.exc_value), 200)
    )


def _command(argv: list[str], console: Console, program: str) -> int:
    """The exit status."""
    if argv[:1] in (["model"], ["doctor"]):
        from posecast_edge.cli.model_command import run_command  # noqa: PLC0415 - `run` stays small without it

        return run_command(argv, os.environ, program)
    if argv[:1] == ["probe"]:
        from posecast_edge.cli.probe import run_probe  # noqa: PLC0415

        return run_probe(argv[1:], program)
    if argv[:1] == ["profile"]:
        from posecast_edge.cli.profile_new import run_profile  # noqa: PLC0415

        return run_profile(argv[1:], program)
    log.setLevel(logging.INFO)
    try:
        return _run(parse_settings(argv, os.environ, program), console)
    except (UsageError, ProfileError, ModelError, SourceError, SchemaError) as e:
        for line in e.lines if isinstance(e, ProfileError) else (e,):
            log.error("%s", line)
        return WRONG_CONFIGURATION
    except KeyboardInterrupt:  # before the signal handlers are set
        return 0


def _leave(status: int) -> NoReturn:
    """End the process at once. A normal interpreter exit would wait for a thread that is opening the link;
    a Zenoh thread that calls back during it aborts the process."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)


def _run(settings: Settings, console: Console) -> int:
    defaults = find_defaults(settings.source)
    profile_path = settings.profile or defaults.profile
    urdf = settings.urdf or defaults.urdf
    model = settings.model or (None if settings.urdf else defaults.model)
    profile = load_profile(profile_path) if profile_path else None
    built = load_built(model) if model else None
    packages = list_packages(settings.packages, os.environ)
    # the page reads URDF only; a model in another format is sent once it has been built
    raw = load_bundle(urdf, packages) if urdf and not built and find_format(urdf) == "urdf" else None
    if raw:
        raw.log_missing()
    source = open_source(settings.source, profile)

    from posecast_edge.agent import Agent, AgentSettings  # noqa: PLC0415 - loads Zenoh, which is slow: not before the flags are checked

    sending = AgentSettings(
        settings.robot, settings.relay, settings.hz, settings.key_interval_s, settings.credential
    )
    agent = Agent(sending, source, profile, console)

    def take_model(bundle: Bundle) -> None:
        agent.set_model(bundle)
        if isinstance(source, Discovering):
            source.take_joints(bundle.joints)

    if built:
        take_model(built)
    build: BackgroundBuild | DescribedModel | None = None
    if raw:
        agent.expect_model(raw)  # building the model may take a minute
        if isinstance(source, Discovering):
            source.take_joints(raw.joints)
    options = settings.list_model_options()
    if urdf and not built:
        from posecast_edge.model.serve.background import BackgroundBuild  # noqa: PLC0415 - the agent stays small without it

        if raw is None and isinstance(source, Discovering):
            source.expect_joints()
            build = BackgroundBuild(urdf, raw, take_model, options, lambda: source.take_joints(()))
        else:
            build = BackgroundBuild(urdf, raw, take_model, options)
    elif isinstance(source, Discovering) and not built:
        from posecast_edge.model.serve.background import DescribedModel  # noqa: PLC0415 - the agent stays small without it

        build = DescribedModel(packages, agent.set_model, agent.expect_model, options)
        source.send_urdf_to(build.take_urdf)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: agent.stop())
    if build:
        build.start()
    try:
        return agent.run()
    finally:
        if build:
            build.stop()
