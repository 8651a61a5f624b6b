"""`python -m tests.adding.programs edge|relay …`: the programs, each with its row more."""

from __future__ import annotations

import sys

from posecast_edge.cli.main import main as run_edge
from posecast_edge.model import robot_file
from posecast_edge.sources import registry
from posecast_relay.cli import main as run_relay
from posecast_relay.config import settings
from posecast_relay.server import roles

import tests.adding.wave
from tests.adding.folder_store import connect_folder
from tests.adding.stick import load_stick

sys.modules["posecast_edge.sources.wave"] = tests.adding.wave  # where a file of its own would be found
registry.KINDS["wave"] = "wave"
robot_file.ROOTS["stick"] = "stick"
robot_file.LOADERS["stick"] = load_stick
settings.STORES.append("folder")
roles.STORES["folder"] = connect_folder

if __name__ == "__main__":
    {"edge": run_edge, "relay": run_relay}[sys.argv[1]](sys.argv[2:])
