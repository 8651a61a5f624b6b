"""`posecast-edge`: the command beside the robot."""

from __future__ import annotations

import logging
import os
import signal
import sys

from posecast_wire.schema import SchemaError

from posecast_edge.console import Console
from posecast_edge.model.bundle import Bundle, ModelError, load_built, load_bundle
from posecast_edge.profile import ProfileError, load_profile
from posecast_edge.settings import Settings, UsageError, parse_settings
from posecast_edge.sources import SourceError, defaults_of, open_source

WRONG_CONFIGURATION = 2


def main() -> None:
    """Entry point; ends the process."""
    if sys.argv[1:2] in (["model"], ["doctor"]):
        from posecast_edge.model.command import run_command  # noqa: PLC0415 - `run` stays small without it

        sys.exit(run_command(sys.argv[1:], os.environ))
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
    sys.exit(status)


def _run(settings: Settings, console: Console) -> int:
    defaults = defaults_of(settings.source)
    profile_path = settings.profile or defaults.profile
    urdf = settings.urdf or defaults.urdf
    model = settings.model or (None if settings.urdf else defaults.model)
    profile = load_profile(profile_path) if profile_path else None
    if model:
        bundle: Bundle | None = load_built(model)
    else:
        bundle = _whole(load_bundle(urdf)) if urdf else None
    source = open_source(settings.source, profile)

    from posecast_edge.agent import Agent  # noqa: PLC0415 - Zenoh costs time and memory a wrong flag need not pay

    agent = Agent(settings, source, profile, bundle, console)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: agent.stop())
    status = agent.run()
    if not agent.link_closed:
        # The link's thread sits in an open() or put() that ends only by itself; nothing is left to save.
        sys.stderr.flush()
        os._exit(status)
    return status


def _whole(bundle: Bundle) -> Bundle:
    """The bundle; what it lacks is said once."""
    if bundle.missing:
        shown = ", ".join(bundle.missing[:3]) + (" …" if len(bundle.missing) > 3 else "")
        logging.getLogger("posecast_edge").warning(
            "model: %d of %d files missing: %s",
            len(bundle.missing),
            len(bundle.files) + len(bundle.missing),
            shown,
        )
    return bundle
