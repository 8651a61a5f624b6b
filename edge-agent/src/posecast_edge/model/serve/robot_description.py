"""Serves the model that a robot publishes as its robot_description, as if it were a file.

Meshes are searched in ROS's folders (ROS_PACKAGE_PATH, AMENT_PREFIX_PATH); placeholders replace meshes that
are not on this machine. A new description replaces the old one.
"""

from __future__ import annotations

import logging
import shutil
import tempfile
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

from posecast_edge.model.serve.background import BackgroundBuild
from posecast_edge.model.serve.bundle import Bundle, ModelError, load_bundle

log = logging.getLogger("posecast_edge.model")

STOP_S = 2.0
# In its own folder: the search near the URDF (resolver.py) must not reach other files in /tmp.
DEPTH = "a/robot/that/describes/itself"


class DescribedModel:
    """Calls `ready` from another thread with a bundle for every usable description."""

    def __init__(
        self,
        packages: Sequence[Path],
        ready: Callable[[Bundle], None],
        heard: Callable[[Bundle], None] = lambda _: None,
        options: Sequence[str] = (),
    ) -> None:
        """`heard` is called before `ready`, as soon as a description was read, with its bundle of raw files;
        `options`: of `model build`, such as package folders."""
        self._options = options
        self._packages = packages
        self._ready = ready
        self._heard = heard
        self._newest: str | None = None  # waits; of several only the newest counts
        self._stopping = False
        self._wake = threading.Condition()
        self._build: BackgroundBuild | None = None
        self._folder = tempfile.TemporaryDirectory(prefix="posecast-urdf-", ignore_cleanup_errors=True)
        self._thread = threading.Thread(target=self._run, name="described", daemon=True)

    def start(self) -> None:
        """Start waiting for descriptions."""
        self._thread.start()

    def take_urdf(self, urdf: str) -> None:
        """Take a new description (URDF text). Returns at once."""
        with self._wake:
            self._newest = urdf
            self._wake.notify()

    def stop(self) -> None:
        """Stop, and delete the files that were made."""
        with self._wake:
            self._stopping = True
            self._wake.notify()
        self._thread.join(STOP_S)
        if self._build is not None:
            self._build.stop()
        self._folder.cleanup()

    def _run(self) -> None:
        number = 0
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._stopping or self._newest is not None)
                urdf, self._newest = self._newest, None
            if self._stopping or urdf is None:
                return
            number += 1
            if self._build is not None:
                self._build.stop()
                self._build = None
            try:
                self._build = self._begin(urdf, Path(self._folder.name, str(number), DEPTH))
            except (ModelError, OSError) as e:
                log.warning("robot_description: %s", e)
            # the one before is still served until this one is ready
            shutil.rmtree(Path(self._folder.name, str(number - 2)), ignore_errors=True)

    def _begin(self, urdf: str, folder: Path) -> BackgroundBuild:
        folder.mkdir(parents=True)
        path = folder / "robot.urdf"
        try:
            path.write_text(urdf, encoding="utf-8")
        except UnicodeEncodeError:
            raise ModelError("it is not valid Unicode (half of a surrogate pair)") from None
        try:
            raw = load_bundle(path, self._packages)
        except ModelError as e:
            raise ModelError(str(e).removeprefix(f"{path}: ")) from None
        self._heard(raw)
        raw.log_missing()
        if raw.missing:
            log.info("model: packages are searched in AMENT_PREFIX_PATH and ROS_PACKAGE_PATH")
        build = BackgroundBuild(path, raw, self._ready, self._options)
        build.start()
        return build
