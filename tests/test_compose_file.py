"""infra/docker-compose.yml, .env.example and the pages about them agree. Nothing is started here."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from posecast_relay.config.settings import FLAGS, SettingsError, parse

from tests.conftest import BIN
from tests.doc_blocks.block import read_blocks

pytestmark = pytest.mark.docs

ROOT = Path(__file__).resolve().parent.parent
TEXT = (ROOT / "infra/docker-compose.yml").read_text()
COMPOSE: dict[str, Any] = yaml.safe_load(TEXT)
ENV = (ROOT / "infra/.env.example").read_text()
INSTALL = (ROOT / "docs/how-to/install/containers.md").read_text()
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
REMOVED = {"RELAY_WORKERS"}  # handed on, so that whoever still sets it is told what to use instead
PROFILES = {name for service in COMPOSE["services"].values() for name in service.get("profiles", ())}


def read_defaults() -> dict[str, str]:
    """The default of each variable in the Compose file."""
    found = dict[str, str]()
    for name, default in re.findall(r"(?<!\$)\$\{([A-Z_]+):-([^}]*)\}", TEXT):
        assert found.setdefault(name, default) == default, name
    assert found.keys() == set(re.findall(r"(?<!\$)\$\{([A-Z_]+)", TEXT)), "each has a default"
    return found


def fill_environment(service: str, **env: str) -> dict[str, str]:
    """The variables that a service gets, by what .env says."""
    values = read_defaults() | env
    return {
        name: re.sub(r"\$\{([A-Z_]+)[^}]*\}", lambda found: values[found[1]], str(value))
        for name, value in COMPOSE["services"][service]["environment"].items()
    }


def test_every_variable_has_a_line_and_every_line_is_one() -> None:
    lines = re.findall(r"^(#?)([A-Z_]+)=(.*)$", ENV, re.MULTILINE)
    names = [name for _, name, _ in lines]
    assert len(names) == len(set(names)), "one that comes twice is only heard once"
    defaults = read_defaults()
    assert set(names) == defaults.keys() - REMOVED | {"COMPOSE_PROFILES"}
    for off, name, value in lines:
        assert off or value == defaults[name], f"{name} differs from what holds without .env"


def test_all_profiles_stand_in_one_line() -> None:
    (profiles,) = re.findall(r"^#COMPOSE_PROFILES=(.*)$", ENV, re.MULTILINE)
    assert set(profiles.split(",")) == PROFILES == {"demo", "gateways", "cache", "observe"}


def test_no_page_mixes_the_flag_with_the_variable() -> None:
    # a --profile flag switches COMPOSE_PROFILES of .env off: to begin with, `demo` may be a flag
    for page in PAGES:
        for line in page.read_text().splitlines():
            for flag in re.findall(r"(?:docker compose|^compose)\b[^`]*--profile (\w+)[^`]* up\b", line):
                assert flag == "demo", f"{page.name}: {line}"
    for text in (INSTALL, (ROOT / "docs/how-to/scale/cache-for-a-crowd.md").read_text()):
        assert "COMPOSE_PROFILES=demo,cache" in text
        assert re.search(r"`--profile`", text)
    rows = dict(re.findall(r"^\| `(\w+)` \| with the profile `(\w+)`", INSTALL, re.MULTILINE))
    assert rows == {
        name: service["profiles"][0] for name, service in COMPOSE["services"].items() if "profiles" in service
    }


def test_the_relay_understands_what_it_is_told() -> None:
    known = {flag.variable for flag in FLAGS}
    here = {"POSECAST_PAST_SOCKET": "/tmp/past.sock", "POSECAST_STORE": "redis://:word@redis:6379"}
    files = ("POSECAST_ROBOTS", "POSECAST_ZENOH_TLS_CERT", "POSECAST_ZENOH_TLS_KEY")
    here |= dict.fromkeys(files, __file__)
    for name, role in (("relay", "all"), ("gateway", "gateway")):
        told = fill_environment(name, MAX_PER_ADDRESS="300")
        assert told.keys() <= known | {"POSECAST_WORKERS"}
        for workers in ("", "1"):  # removed, but it may stand in an old .env
            told = fill_environment(name, MAX_PER_ADDRESS="300", RELAY_WORKERS=workers)
            found = parse(["run"], told | here)
            assert (found.role, found.max_per_address) == (role, 300)
        with pytest.raises(SettingsError, match=r"^POSECAST_WORKERS '4': removed, .* run gateways"):
            parse(["run"], fill_environment(name, RELAY_WORKERS="4") | here)


def test_the_page_takes_a_config_file_where_the_proxy_has_the_page() -> None:
    (text,) = read_blocks("docs/how-to/install/containers.md", "yaml", "proxy:")
    (volume,) = yaml.safe_load(text)["services"]["proxy"]["volumes"]
    assert volume == "./config.json:/srv/config.json:ro"
    assert "root * {$PAGE:/srv}" in (ROOT / "infra/Caddyfile").read_text()
    assert "PAGE" not in COMPOSE["services"]["proxy"]["environment"]


def test_the_proxy_falls_back_on_the_relay() -> None:
    caddyfile = (ROOT / "infra/Caddyfile").read_text()
    _, _, errors = caddyfile.partition("handle_errors 502 503 504 {")
    assert re.match(
        r"\s*handle @lane \{\s*reverse_proxy \{\s*dynamic a \{\s*name \{\$VIEWERS_AT:relay\}", errors
    )


def test_the_proxy_takes_what_compose_tells_it() -> None:
    """An empty variable is different from an unset one: Caddy then uses no default."""
    told = fill_environment("proxy")
    assert "" in told.values()
    adapt = (BIN / "caddy", "adapt", "--config", ROOT / "infra/Caddyfile", "--adapter", "caddyfile")
    for cache in (told["LANE_AT"], "cache"):
        env = os.environ | told | {"LANE_AT": cache}
        done = subprocess.run(adapt, env=env, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def test_one_port_changes_only_ports_and_networks() -> None:
    text = (ROOT / "infra/one-port.yml").read_text()
    defaults = read_defaults()
    for name, default in re.findall(r"\$\{([A-Z_]+):-([^}]*)\}", text):
        assert defaults[name] == default
    changed = yaml.safe_load(text.replace("!override", ""))["services"]
    assert changed.keys() == {"robots", "proxy"}
    base = COMPOSE["services"]
    assert set(changed["robots"]["networks"]) == {"robots", "web"}
    assert "web" in base["proxy"]["networks"], "nginx reaches the proxy there"
    assert changed["proxy"]["ports"] == [port for port in base["proxy"]["ports"] if not port.endswith(":443")]
    (shared,) = changed["robots"]["ports"]
    assert shared.endswith(":7443")
    assert "listen 7443;" in (ROOT / "infra/robots.conf").read_text()
    (variable,) = changed["proxy"]["environment"]
    assert f"{{${variable}:" in (ROOT / "infra/Caddyfile").read_text()
    page = (ROOT / "docs/how-to/operate/container-recipes.md").read_text()
    assert "`-f infra/one-port.yml` after `-f infra/docker-compose.yml`" in page
