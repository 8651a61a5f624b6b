"""Builds the model of a robot that is already on air, in a separate process, so that the agent stays small
and on time. A cached model is used at once (bundle_dir.py)."""

from __future__ import annotations

import contextlib
import importlib.util
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from posecast_wire.command_line.installation import name_edge_command

from posecast_edge.model.finding import advise_mesh_tools, explain_coarser
from posecast_edge.model.serve.bundle import Bundle, ModelError, load_built, load_bundle

log = logging.getLogger("posecast_edge.model")

NEEDED = ("numpy", "PIL")  # the extra [model]
BUILD_MAX_S = 900.0
STOP_S = 2.0
WRITTEN = (0, 1)  # exit statuses; 1: only placeholders
NICE = 10  # the robot's own programs go first


def can_build() -> bool:
    """Whether the mesh tools are installed."""
    return all(importlib.util.find_spec(name) is not None for name in NEEDED)


class BackgroundBuild:
    """Calls `ready` with the built bundle, or with the raw one if it can't be built; at once if the mesh
    tools are missing."""

    def __init__(
        self,
        urdf: Path,
        raw: Bundle | None,
        ready: Callable[[Bundle], None],
        options: Sequence[str] = (),
        failed: Callable[[], None] = lambda: None,
    ) -> None:
        """`raw`: None for a format that only the builder reads; `options`: of `model build`, such as package
        folders; `failed` is called when there will be no bundle."""
        self._urdf, self._raw, self._ready, self._options = urdf, raw, ready, options
        self._failed = failed
        self._folder: str | None = None
        self._process: subprocess.Popen[str] | None = None
        self._lock = threading.Lock()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="model", daemon=True)

    def start(self) -> None:
        """Start the build; `ready` is called by another thread."""
        if can_build():
            self._thread.start()
            return
        if self._raw is None:
            log.warning(
                "model: %s is not shown: it needs the mesh tools: %s", self._urdf, advise_mesh_tools()
            )
            self._failed()
            return
        if len(self._raw.files) > 1:  # it has meshes, or pictures
            log.warning(
                "model: meshes are sent unchanged, %s; to make them smaller, %s",
                describe_size(self._raw),
                advise_mesh_tools(),
            )
        self._log_findings(self._raw)
        self._ready(self._raw)

    def stop(self) -> None:
        """Terminate the process if it still runs, and delete its files."""
        with self._lock:
            self._stopping = True
            if self._process is not None:
                self._process.kill()
        if self._thread.is_alive():
            self._thread.join(STOP_S)
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    def _run(self) -> None:
        began_s = time.monotonic()
        try:
            bundle = self._built()
        except (ModelError, OSError, subprocess.SubprocessError) as e:
            if not self._stopping:
                otherwise = "not shown" if self._raw is None else "not built, meshes are sent unchanged"
                log.warning("model: %s: %s", otherwise, e)
                if self._raw is not None:
                    self._ready(self._raw)
                else:
                    self._failed()
            return
        if self._stopping:
            return
        took_s = time.monotonic() - began_s
        raw = f" from {describe_size(self._raw)}" if self._raw is not None else ""
        log.info("model: built %s%s in %.1f s", describe_size(bundle), raw, took_s)
        if coarser := explain_coarser():
            log.warning("model: %s", coarser)
        self._log_findings(bundle)
        self._ready(bundle)

    def _log_findings(self, bundle: Bundle) -> None:
        if problems := _count_findings(bundle):
            doctor = name_edge_command("doctor")
            log.warning("model: %s; %s --urdf %s lists them", problems, doctor, self._urdf)

    def _built(self) -> Bundle:
        """The built bundle. Raises ModelError with the builder's last line."""
        # no TemporaryDirectory: a fork of this process would delete it on exit
        self._folder = tempfile.mkdtemp(prefix="posecast-model-")
        out = Path(self._folder, "bundle")
        program = [sys.executable, "-m", "posecast_edge", "model", "build"]
        command = [*program, str(self._urdf), "-o", str(out), *self._options]
        with self._lock:
            if self._stopping:
                raise ModelError("stopped")
            self._process = subprocess.Popen(  # Ctrl-C is for the agent, which ends this process
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                start_new_session=True,
            )
        with self._process as process:
            with contextlib.suppress(OSError):  # it has ended already
                os.setpriority(os.PRIO_PROCESS, process.pid, NICE)
            try:
                _, output = process.communicate(timeout=BUILD_MAX_S)
            except subprocess.TimeoutExpired:
                process.kill()
                raise
        if process.returncode not in WRITTEN:
            last = output.strip().rpartition("\n")[2] or f"exit status {process.returncode}"
            raise ModelError(last.removeprefix("posecast-edge: "))
        return load_built(out)


def _count_findings(bundle: Bundle) -> str:
    """`2 errors, 1 warning` in the URDF, "" when there are none."""
    severities = [f.severity for f in bundle.findings]
    counts = [(severities.count(s), s) for s in ("error", "warning")]
    return ", ".join(f"{n} {s}{'s' if n > 1 else ''}" for n, s in counts if n)


def describe_size(bundle: Bundle) -> str:
    """The size of all its files together, kB or MB."""
    size = sum(f.size for f in bundle.files)
    return f"{size / 1e6:.1f} MB" if size >= 100_000 else f"{size / 1e3:.0f} kB"


# --- the model that a robot publishes as its robot_description

# In its own folder: the search near the URDF (resolver.py) must not reach other files in /tmp.
DEPTH = "a/robot/that/describes/itself"


class DescribedModel:
    """Calls `ready` from another thread with a bundle for every usable description.

    A new one replaces the old. Meshes are searched in ROS's folders (ROS_PACKAGE_PATH, AMENT_PREFIX_PATH);
    placeholders replace meshes that are not on this machine.
    """

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
