"""MuJoCo models: the files that one names, and what the process that compiles one answers."""

from __future__ import annotations

import io
from pathlib import Path

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.mjcf.compiled import read_model
from posecast_edge.model.mjcf.files import list_names
from posecast_edge.model.mjcf.reader import make_robot
from posecast_edge.model.urdf.tree import build_tree

from fuzz.target import Differs, Target


def names(data: bytes) -> None:
    """What is looked for beside a model."""
    for _, name in list_names(data):
        if "\0" in name or not name:
            raise Differs("no name for a file")


def answer(data: bytes) -> None:
    """What a compiler that went wrong may write."""
    build_tree(make_robot(read_model(io.BytesIO(data)), Path("model.xml")).urdf)


TARGETS = (
    Target("mjcf", names),
    Target("mjcf-answer", answer, (ModelRefused,)),
)
