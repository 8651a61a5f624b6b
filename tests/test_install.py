"""Wheels, installed outside the checkout, put a robot on air without a route to the internet.

The commands are those in docs/how-to/install.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from posecast_edge.cli.settings import Settings, parse_settings
from posecast_relay.config.settings import Settings as RelaySettings
from posecast_relay.config.settings import parse as parse_relay_settings
from posecast_testing import until

from tests.conftest import BIN
from tests.doc_blocks.block import read_blocks
from tests.namespaces import Namespace

ROOT = Path(__file__).resolve().parent.parent
PAGES = ROOT / "docs/how-to/install"
UNIT = ROOT / "infra" / "systemd" / "posecast-edge@.service"
RELAY_UNIT = ROOT / "infra" / "systemd" / "posecast-relay.service"
UV = ROOT / ".tools" / "bin" / "uv"
INSTALLED_MB, WITH_MODELS_MB = 130, 220
# what a stranger's machine has; above all no PIP_FIND_LINKS and nothing of the make that runs these tests
PLAIN = {
    k: v for k, v in os.environ.items() if not k.startswith(("PIP_FIND", "MAKE", "MFLAGS", "PYTHON", "UV_"))
}


def blocks(page: str, kind: str = "sh") -> list[str]:
    """Code of one kind on a page, in order, also in steps of a list."""
    return read_blocks(f"docs/how-to/install/{page}.md", kind)


def sh(script: str, folder: Path) -> None:
    """Runs it, shows what it said when it fails."""
    done = subprocess.run(
        ["bash", "-euc", script],
        cwd=folder,
        env=PLAIN,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, f"{script}\n{done.stdout}{done.stderr}"


@pytest.fixture(scope="session")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder where `make dist` left the wheels: once, also with several workers."""
    assert "make dist\n" in blocks("install")
    assert "```sh\nmake dist\n```" in (ROOT / "docs/index.md").read_text(encoding="utf-8")
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "dist"
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            sh(f"make --silent dist DIST={folder}.part && mv {folder}.part {folder}", ROOT)
    assert sorted(wheel.name.split("-")[0] for wheel in folder.glob("*.whl")) == [
        "posecast",
        "posecast_edge",
        "posecast_relay",
        "posecast_wire",
    ]
    return folder


@pytest.fixture
def alone() -> Iterator[Any]:
    """A namespace with a loopback interface and nothing else."""
    place = Namespace()
    place.do("ip link set lo up")
    yield place
    place.close()


def on_air(stack: Any, place: Any, relay: Path, edge: Path) -> str:
    """Starts both from their own virtual environments in a namespace without a route; the relay's URL."""
    run: Callable[..., Any] = place.run
    serving = run(
        lambda: stack.start("relay", str(relay / "bin/posecast-relay"), "run", "--dev", "--port", "8080")
    )
    found = serving.line(r"serving (http://\S+), robots on")
    words = ("run", "--robot", "demo", "--source", "demo", "--relay", "tcp/127.0.0.1:7447")
    run(lambda: stack.start("edge", str(edge / "bin/posecast-edge"), *words))
    return str(found[1])


def get(place: Any, url: str) -> bytes:
    def ask() -> bytes:
        with urllib.request.urlopen(url, timeout=5) as answer:
            body: bytes = answer.read()
            return body

    found: bytes = place.run(ask)
    return found


def moves(place: Any, url: str) -> None:
    """Until the demo robot has stood in five poses."""
    seen: set[str] = set()

    def five() -> bool:
        try:
            state = json.loads(get(place, f"{url}/api/v1/robots/demo/state"))
        except OSError:
            return False
        seen.add(json.dumps(state["fields"]["pos"]["values"]))
        return len(seen) >= 5

    until("the robot moves", five)


def whole_page(place: Any, url: str) -> None:
    """Every file of the built page is there, and none comes from elsewhere."""
    index = get(place, f"{url}/").decode()
    assert not re.findall(r"(?:src|href)=\"(?:https?:)?//", index)
    linked = re.findall(r"(?:src|href)=\"\./([^\"]+)\"", index)
    built = json.loads(get(place, f"{url}/.vite/manifest.json"))
    files = {*linked, *(f for chunk in built.values() for f in (chunk["file"], *chunk.get("css", ())))}
    assert len(files) > 5
    for file in files:
        assert get(place, f"{url}/{file}"), file


def routes_page(place: Any, url: str) -> None:
    """FastAPI's documentation of the routes, with its own files."""
    page = get(place, f"{url}/docs").decode()
    files = re.findall(r"(?:src|href)=\"\./([^\"]+)\"", page)
    assert len(files) == 3
    assert "//" not in re.sub(r"<!--.*?-->", "", page, flags=re.DOTALL)
    for file in files:
        assert get(place, f"{url}/docs/{file}"), file
    assert "/api/v1/robots/{robot}/state" in json.loads(get(place, f"{url}/openapi.json"))["paths"]


def guide_page(place: Any, url: str) -> None:
    """The guide with its own files, and what it finds by."""
    page = get(place, f"{url}/guide/").decode()
    files = re.findall(r"(?:src|href)=\"\./((?:assets|look)/[^\"]+)\"", page)
    assert len(files) > 5
    for file in (*files, "search.js", "reference/routes.html"):
        assert get(place, f"{url}/guide/{file}"), file


def take_uv(script: str, venv: str) -> str:
    """The page's commands with uv, which takes what setup has fetched already, in place of pip, which would
    download it."""
    made = script.replace("python3 -m venv /opt/posecast", f"{sys.executable} -m venv --without-pip {venv}")
    return made.replace("/opt/posecast/bin/pip install", f"{UV} pip install --quiet --python {venv}")


def test_wheels_put_a_robot_on_air_without_internet(
    stack: Any, wheels: Path, alone: Any, tmp_path: Path
) -> None:
    (tmp_path / "dist").symlink_to(wheels)
    of_relay, of_edge, extras = (b for b in blocks("install") if "dist/posecast_" in b)
    for name, script in (("relay", of_relay), ("edge", of_edge)):
        sh(take_uv(script, name), tmp_path)
    assert not list((tmp_path / "edge").glob("lib/*/site-packages/numpy")), "extras are extras"
    url = on_air(stack, alone, tmp_path / "relay", tmp_path / "edge")
    moves(alone, url)
    whole_page(alone, url)
    routes_page(alone, url)
    guide_page(alone, url)
    sh(take_uv(extras, "relay"), tmp_path)
    assert list((tmp_path / "relay").glob("lib/*/site-packages/obstore"))


def test_the_extras_of_pages_can_be_installed(wheels: Path, tmp_path: Path) -> None:
    (tmp_path / "dist").symlink_to(wheels)
    sh(f"{sys.executable} -m venv --without-pip venv", tmp_path)
    for page in (*(f"robots/{name}" for name in ("mujoco", "ros2", "rosbridge", "urdf")), "record/mcap"):
        text = (PAGES.parent / f"{page}.md").read_text(encoding="utf-8")
        (line,) = re.findall(r"^pip install .*$", text, re.MULTILINE)
        sh(line.replace("pip install", f"{UV} pip install --quiet --dry-run --python venv"), tmp_path)


def megabytes(folder: Path) -> float:
    """What a folder takes on a disk, without what Python compiles."""
    files = {path: path.lstat() for path in folder.rglob("*") if "__pycache__" not in path.parts}
    return sum(found.st_blocks * 512 for found in files.values()) / 1e6


def test_one_wheel_is_all_of_it(stack: Any, wheels: Path, alone: Any, tmp_path: Path) -> None:
    (wheel,) = wheels.glob("posecast-*.whl")
    sh(
        f"{sys.executable} -m venv --without-pip venv\n{UV} pip install --quiet --python venv {wheel}\n"
        "venv/bin/python -c 'import posecast; posecast.Robot'",
        tmp_path,
    )
    assert megabytes(tmp_path / "venv") <= INSTALLED_MB
    # of the commands that other pages name none is missing
    commands = {path.name for path in (tmp_path / "venv/bin").iterdir()}
    assert {"posecast", "posecast-edge", "posecast-relay"} <= commands

    def start() -> Any:
        return stack.start("demo", str(tmp_path / "venv/bin/posecast"), "demo", "--no-browser")

    url = str(alone.run(start).line(r"on air:  (http://[^/]+)/#/r/demo")[1])
    moves(alone, url)
    whole_page(alone, url)
    routes_page(alone, url)
    guide_page(alone, url)
    # and what builds models is small too
    sh(f"{UV} pip install --quiet --python venv '{wheel}[model]'", tmp_path)
    assert megabytes(tmp_path / "venv") <= WITH_MODELS_MB


@pytest.mark.full
@pytest.mark.parametrize("how", ["uvx", "pip install"])
def test_one_command_is_enough(how: str, stack: Any, wheels: Path, tmp_path: Path) -> None:
    (line,) = (block.strip() for block in blocks("install") if how in block and "posecast demo" in block)
    (tmp_path / "dist").symlink_to(wheels)
    path = f"PATH={UV.parent}:{os.environ['PATH']}"
    demo = stack.start("demo", "env", path, "bash", "-euc", f"cd {tmp_path}\n{line} --no-browser")
    until("it is on air", lambda: "on air:" in demo.out, 240)


@pytest.mark.full
def test_a_wheelhouse_is_enough(stack: Any, wheels: Path, alone: Any, tmp_path: Path) -> None:
    fill, install = (b for b in blocks("offline-and-arm64") if "wheelhouse\n" in b or "--no-index" in b)
    for name in ("edge", "relay"):
        site = tmp_path / name
        site.mkdir()
        (site / "dist").symlink_to(wheels)
        (site / ".tools").symlink_to(ROOT / ".tools")
        for file in ("uv.lock", "pyproject.toml"):
            (site / file).symlink_to(ROOT / file)
        for package in ("wire/python", "edge-agent", "relay", "loadtests", "command"):
            (site / package).mkdir(parents=True)
            (site / package / "pyproject.toml").symlink_to(ROOT / package / "pyproject.toml")
        sh(fill.replace("posecast-edge", f"posecast-{name}"), site)
        away = tmp_path / f"{name}-away"
        away.mkdir()
        shutil.copytree(site / "wheelhouse", away / "wheelhouse")
        here = install.replace("/opt/posecast", "venv").replace("posecast-edge", f"posecast-{name}")
        alone.run(lambda here=here, away=away: sh(here, away))
    url = on_air(stack, alone, tmp_path / "relay-away/venv", tmp_path / "edge-away/venv")
    moves(alone, url)
    whole_page(alone, url)
    routes_page(alone, url)
    guide_page(alone, url)


@pytest.mark.full
def test_an_arm64_board_finds_every_wheel(wheels: Path, tmp_path: Path) -> None:
    (script,) = (b for b in blocks("offline-and-arm64") if "aarch64" in b)
    (tmp_path / "dist").symlink_to(wheels)
    (tmp_path / ".tools").symlink_to(ROOT / ".tools")
    sh(script, tmp_path)
    found = sorted(path.name for path in (tmp_path / "wheelhouse-arm64").iterdir())
    assert [name.split("-")[0] for name in found] == [
        "eclipse_zenoh",
        "posecast_edge",
        "posecast_wire",
        "tomli",
    ]
    assert [name for name in found if not name.endswith(("aarch64.whl", "-none-any.whl"))] == []


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl here")
def test_a_robot_reaches_a_relay_on_another_machine(stack: Any, tmp_path: Path) -> None:
    """Word for word, but for names, paths and ports."""
    keys, serve, publish = (
        next(b for b in blocks("install") if words in b)
        for words in ("openssl", "posecast-relay run", "posecast-edge run")
    )

    def here(script: str) -> str:
        return script.replace("/opt/posecast/bin", str(BIN)).replace("RELAY", "localhost")

    def words(script: str) -> list[str]:
        """With the files that `keys` has made."""
        return [str(tmp_path / word) if (tmp_path / word).is_file() else word for word in shlex.split(script)]

    sh(here(keys), tmp_path)
    credential = tmp_path / "hubo.credential"
    assert credential.stat().st_mode & 0o077 == 0
    free = here(serve).replace("--port 8080", "--port 0").replace("0.0.0.0:7447", "0.0.0.0:0")
    relay = stack.start("relay", *words(free))
    port = relay.line(r"robots on tls/0\.0\.0\.0:(\d+)")[1]
    edge = stack.start("edge", *words(here(publish).replace("7447", port)))
    until("hubo is on air", lambda: "hubo | on air" in edge.log)


@pytest.mark.docs
def test_the_service_reads_settings_that_exist(tmp_path: Path) -> None:
    (text,) = (b for b in blocks("service", "ini") if "POSECAST_RELAY=" in b)
    given = dict(line.split("=", 1) for line in text.splitlines())
    fixed = dict(re.findall(r"(POSECAST_\w+)=(\S+)", UNIT.read_text(encoding="utf-8")))
    assert fixed == {"POSECAST_ROBOT": "%i"}
    # the account is made anew at each start: what is not everybody's it reads by its group
    (group,) = re.findall(r"^SupplementaryGroups=(\w+)$", UNIT.read_text(encoding="utf-8"), re.MULTILINE)
    (steps,) = (b for b in blocks("service") if "hubo.credential" in b)
    path = given["POSECAST_CREDENTIAL"]
    assert steps.startswith(
        f"groupadd --system {group}\ninstall -D -m 640 -g {group} hubo.credential {path}\n"
    )
    credential = tmp_path / "hubo.credential"
    credential.write_text(f"posecast1:hubo:{'s' * 43}\n", encoding="ascii")
    credential.chmod(0o640)
    read = {**given, "POSECAST_CREDENTIAL": str(credential), "POSECAST_ROBOT": "hubo"}
    assert parse_settings(["run"], read).robot == "hubo"
    known = {f"POSECAST_{name.upper()}" for name in Settings.__dataclass_fields__}
    assert set(given) <= known


@pytest.mark.docs
def test_the_relays_service_reads_settings_that_exist(tmp_path: Path) -> None:
    unit = RELAY_UNIT.read_text(encoding="utf-8")
    fixed = dict(re.findall(r"(POSECAST_\w+)=(\S+)", unit))
    (text,) = (b for b in blocks("service", "ini") if "POSECAST_ZENOH_LISTEN=" in b)
    given = fixed | dict(line.split("=", 1) for line in text.splitlines())
    (steps,) = (b for b in blocks("service") if "useradd" in b)

    def is_set(name: str, value: str) -> bool:
        return f"\n{name}={value}\n" in unit

    # the folder is on the disk, so neither a mount that failed nor one that is missing is written beside
    folder = Path(fixed["POSECAST_PAST"].removeprefix("file://"))
    assert is_set("RequiresMountsFor", str(folder.parent))
    assert is_set("ReadWritePaths", str(folder))
    assert is_set("UMask", "0077")
    (user,) = re.findall(r"^User=(\S+)$", unit, re.MULTILINE)
    assert f"install -d -m 700 -o {user} -g {user} {folder} /var/lib/{user}\n" in steps
    assert is_set("StateDirectory", user)
    assert is_set("RuntimeDirectory", user)
    assert fixed["POSECAST_PAST_SOCKET"].startswith(f"/run/{user}/")
    here = dict(given, POSECAST_PAST_SOCKET=str(tmp_path / "past.sock"))
    for name, value in given.items():
        if value.startswith(f"/var/lib/{user}/"):
            here[name] = str(tmp_path / Path(value).name)
            Path(here[name]).touch(0o600)
    read = parse_relay_settings(["run"], here)
    assert read.archive == fixed["POSECAST_PAST"]
    known = {f"POSECAST_{name.upper()}" for name in RelaySettings.__dataclass_fields__}
    assert set(given) <= known


@pytest.mark.docs
@pytest.mark.parametrize("service", ["posecast-edge@hubo", "posecast-relay"])
def test_the_services_are_started(service: str) -> None:
    unit = UNIT if "@" in service else RELAY_UNIT
    steps = "".join(blocks("service"))
    order = [f"cp infra/systemd/{unit.name} ", "daemon-reload\n", f"enable --now {service}\n"]
    assert re.search(".*".join(map(re.escape, order)), steps, re.DOTALL)


@pytest.mark.parametrize(
    ("unit", "instance"), [(UNIT, "posecast-edge@hubo.service"), (RELAY_UNIT, RELAY_UNIT.name)]
)
def test_systemd_takes_the_unit(unit: Path, instance: str, tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd-analyze here")
    # verify wants the program to be there
    text = re.sub(r"/opt/posecast/bin/\S+", "/bin/true", unit.read_text(encoding="utf-8"))
    (tmp_path / unit.name).write_text(text, encoding="utf-8")
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(tmp_path / instance)],
        capture_output=True,
        text=True,
        check=False,
    )
    ours = [line for line in done.stderr.splitlines() if unit.stem in line]
    assert ours == []
