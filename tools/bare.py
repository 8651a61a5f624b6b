"""`make bare`: from an empty Debian 12 and an empty Ubuntu 24.04, with only Python and without internet, to a
robot on air from a folder of wheels. Measures seconds and megabytes. Needs root and mmdebstrap.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "out" / "bare"
# libstdc++6: numpy needs it, and the smallest Ubuntu lacks it
PACKAGES = "python3,python3-venv,libstdc++6"
PLATFORMS = ("manylinux_2_28_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64")
FOR = ("--python-platform", "x86_64-manylinux_2_28")
FIRST_S, AGAIN_S, INSTALLED_MB, WITH_MODELS_MB = 30.0, 3.0, 130, 220
EMPTY = "python3 -m venv /opt/empty && echo done"
INSTALL = "python3 -m venv /opt/v && /opt/v/bin/pip install --quiet --no-index --find-links /wheels posecast"
DEMO = "exec /opt/v/bin/posecast demo --no-browser"
MODELS = "/opt/v/bin/pip install --quiet --no-index --find-links /wheels 'posecast[model]'"
BUILD = (
    "cd /opt/v/lib/python3*/site-packages/posecast_edge/demo_bundle && "
    "/opt/v/bin/posecast model build --no-cache robot.urdf -o /tmp/model"
)
LIMIT_S = 600.0
PLAIN = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/root", "LANG": "C.UTF-8"}


@dataclass(frozen=True)
class System:
    """A release of an operating system, and its Python version."""

    name: str
    suite: str
    mirror: str
    python: str


SYSTEMS = (
    System("Debian 12", "bookworm", "http://deb.debian.org/debian", "3.11.2"),
    # its keys are not in Debian's keyring; nothing of it is kept
    System(
        "Ubuntu 24.04",
        "noble",
        "deb [trusted=yes] http://archive.ubuntu.com/ubuntu noble main universe",
        "3.12.3",
    ),
)


def main() -> int:
    """Measure both; returns 1 if a limit is exceeded."""
    failed = False
    for system in SYSTEMS:
        folder = OUT / system.suite
        if not (folder / "usr").exists():
            folder.parent.mkdir(parents=True, exist_ok=True)
            words = ("--variant=minbase", f"--include={PACKAGES}", system.suite, str(folder), system.mirror)
            subprocess.run(["mmdebstrap", "--quiet", *words], check=True)
        subprocess.run(["rm", "-rf", folder / "opt", folder / "wheels", folder / "tmp/model"], check=True)
        fill(folder / "wheels", system)
        figures = measure(folder)
        failed |= any(value > most for _, value, most in figures)
        said = ", ".join(f"{what} {value:.1f} (at most {most})" for what, value, most in figures)
        print(f"{system.name}: {said}; load average {os.getloadavg()[0]:.1f}", flush=True)
    return int(failed)


def fill(wheels: Path, system: System) -> None:
    """Put the wheel and its dependencies into a folder, as the guide does for an arm64 board."""
    (wheel,) = (ROOT / "dist").glob("posecast-*.whl")
    bin_ = ROOT / ".tools" / "bin"
    compiled = subprocess.run(
        [bin_ / "uv", "pip", "compile", "--quiet", "-", "--python-version", system.python, *FOR],
        input=f"{wheel}[model]",
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    listed = wheels.with_suffix(".txt")
    listed.write_text(compiled)
    of = [word for platform in PLATFORMS for word in ("--platform", platform)]
    only = ("--no-deps", "--only-binary", ":all:", "--python-version", system.python, *of)
    words = ("-m", "pip", "download", "--quiet", *only, "-r", str(listed), "-d", str(wheels))
    subprocess.run([bin_ / "python", *words], check=True)


def measure(folder: Path) -> list[tuple[str, float, float]]:
    """(what, figure, bound)."""
    first = run(folder, f"{INSTALL} && {DEMO}", "on air:")
    again = run(folder, DEMO, "on air:")
    run(folder, EMPTY, "done")
    empty = megabytes(folder / "opt/empty")  # mostly pip
    installed = megabytes(folder / "opt/v") - empty
    run(folder, f"{MODELS} && {BUILD}", "triangles")
    return [
        ("first time, s", first, FIRST_S),
        ("again, s", again, AGAIN_S),
        ("installed, MB", installed, INSTALLED_MB),
        ("with model building, MB", megabytes(folder / "opt/v") - empty, WITH_MODELS_MB),
    ]


def run(folder: Path, script: str, until: str) -> float:
    """Seconds until the script has printed `until`, in the chroot and without a network."""
    inside = (
        f"ip link set lo up; mount -t proc proc {folder}/proc && exec chroot {folder} /bin/sh -c '{script}'"
    )
    command: list[str] = [
        "unshare",
        "--net",
        "--pid",
        "--mount",
        "--fork",
        "--kill-child",
        "bash",
        "-c",
        inside,
    ]
    begun_s = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=PLAIN) as process:
        late = threading.Timer(LIMIT_S, process.kill)
        late.start()
        assert process.stdout is not None
        found = next((line for line in process.stdout if until in line), None)
        took_s = time.monotonic() - begun_s
        late.cancel()
        process.kill()  # and with it everything inside
    if found is None:
        raise SystemExit(f"{folder.name}: ended without {until!r}")
    return took_s


def megabytes(folder: Path) -> float:
    """A folder's size on disk."""
    return sum(path.lstat().st_blocks for path in folder.rglob("*")) * 512 / 1e6


if __name__ == "__main__":
    sys.exit(main())
