"""The commands of the pages on services, archives and web servers, typed as root on a private machine."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from relay.tests.certificates import certificates
from tests.doc_blocks.block import ROOT, read_pages
from tests.doc_blocks.machine import Machine
from tests.doc_blocks.terminal import read_script

SERVICE, KEEP = "docs/how-to/install/service.md", "docs/how-to/operate/keep-months.md"
CACHE = "docs/how-to/scale/cache-for-a-crowd.md"
FILES = ("relay.key", "relay.pem", "robots.toml")
UNIT = ROOT / "infra/systemd/posecast-relay.service"
START_RELAY = """
settings=$(grep -oh 'POSECAST_[A-Z_]*=[^ ]*' infra/systemd/posecast-relay.service /etc/posecast/relay.env)
env -i PATH="$PATH" $settings posecast-relay run > posecast-relay.log 2>&1 &
wait_for curl -sf http://127.0.0.1:8080/readyz
"""  # as the unit does
START_ROBOT = """
credential=/etc/posecast/hubo.credential
posecast-edge run --credential $credential --source demo --relay tls/localhost:7447 > edge.log 2>&1 &
"""


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    if shutil.which("openssl") is None or shutil.which("curl") is None:
        pytest.skip("no openssl or no curl here")
    certificates(tmp_path, "relay", "DNS:localhost")
    return Machine(tmp_path)


def read_block(page: str, language: str, words: str) -> str:
    (text,) = (b.text for b in read_pages()[page] if b.language == language and words in b.text)
    return text


def install(machine: Machine) -> str:
    """The script that installs and starts both services as the page says."""
    settings = read_block(SERVICE, "ini", "POSECAST_ZENOH_LISTEN")
    (machine.folder / "relay.env").write_text(settings, encoding="utf-8")
    edge, relay = read_script(SERVICE, "groupadd"), read_script(SERVICE, "useradd")
    add = "posecast-relay robots add hubo --robots robots.toml --ca ca.pem"
    start_edge = read_script(SERVICE, "enable --now posecast-edge")
    start_relay = read_script(SERVICE, "enable --now posecast-relay")
    enable_edge, enable_relay = (
        script.replace("journalctl", ": journalctl") for script in (start_edge, start_relay)
    )
    return f"""
(umask 077; {add} > hubo.credential)
{edge}{enable_edge}{relay}{enable_relay}
mkdir -p /run/posecast-relay
{START_RELAY}"""


def test_the_services_are_installed(machine: Machine) -> None:
    robots, past = read_script(SERVICE, "runuser").splitlines()
    said = machine.run(
        f"""{install(machine)}
        stat -c '%n %a %U %G' /etc/posecast/* /srv/posecast/past /var/lib/posecast-relay/*
        {robots}
        {past}"""
    )
    assert re.findall(r"^/\S+ \d+ \S+ \S+$", said, re.MULTILINE) == [
        "/etc/posecast/hubo.credential 640 root posecast",
        "/etc/posecast/relay.env 600 root root",
        "/srv/posecast/past 700 posecast-relay posecast-relay",
        *(f"/var/lib/posecast-relay/{file} 600 posecast-relay posecast-relay" for file in FILES),
    ]
    assert re.search(r"^hubo\b", said, re.MULTILINE)


def test_months_of_a_past_are_kept(machine: Machine) -> None:
    alias, keep, look, after, link = (
        read_script(KEEP, words) for words in ("alias", "--keep 30d", "journalctl", "curl", "robots link")
    )
    days, stop = read_script(KEEP, "--days\n"), read_script(KEEP, "--keep 0")
    said = machine.run(
        f"""{install(machine)}{START_ROBOT}{alias}{keep}
        cat /var/lib/posecast-relay/robots.toml
        wait_for grep -q 'hubo: the store keeps its past for 30 d' posecast-relay.log
        {look}
        wait_for sh -c 'find /srv/posecast/past | grep -q segment$'
        {after}
        {link}{days}{stop}"""
    )
    assert "hubo: the store keeps its past for 30 d" in said, "in the log"
    shown = read_block(KEEP, "toml", "keep")
    written = re.sub(r'secret = ".*"', 'secret = "…"', said)
    for line in shown.splitlines():
        assert re.search(rf"^{re.escape(line)}$", written, re.MULTILINE), line
    assert re.search(r"^hubo +public +2\S+Z? ", said, re.MULTILINE)
    assert '{"status":"ready"}' in said.replace(" ", "")
    assert "https://relay.example/#/r/hubo?t=" in said


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze here")
def test_systemd_takes_another_place_for_the_past(tmp_path: Path) -> None:
    unit = re.sub(r"/opt/posecast/bin/\S+", "/bin/true", UNIT.read_text(encoding="utf-8"))
    (tmp_path / UNIT.name).write_text(unit, encoding="utf-8")
    edited = tmp_path / f"{UNIT.name}.d" / "override.conf"
    edited.parent.mkdir()

    def list_complaints(text: str) -> list[str]:
        edited.write_text(text, encoding="utf-8")
        command = ["systemd-analyze", "verify", "--man=no", str(tmp_path / UNIT.name)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
        return [line for line in done.stderr.splitlines() if "override.conf" in line]

    shown = read_block(SERVICE, "ini", "RequiresMountsFor")
    assert list_complaints(shown) == []
    assert list_complaints(shown.replace("ReadWritePaths", "ReadWritePath")) != []


@pytest.mark.skipif(shutil.which("nginx") is None, reason="no nginx here")
def test_nginx_is_installed_before_a_relay_and_counts_viewers(machine: Machine) -> None:
    count = read_script(CACHE, "posecast.log")
    said = machine.run(
        f"""
        posecast-relay run --dev --trusted-proxies 127.0.0.1 > relay.log 2>&1 &
        wait_for curl -sf http://127.0.0.1:8080/readyz
        posecast-edge run --robot demo --source demo --relay tcp/127.0.0.1:7447 > edge.log 2>&1 &
        mkdir /etc/posecast
        cp relay.pem /etc/posecast/fullchain.pem && cp relay.key /etc/posecast/privkey.pem
        nginx
        {read_script(CACHE, "nginx -t")}
        at=https://localhost/api/v1/robots/demo/past
        wait_for sh -c "curl -sfk $at | grep -q '\\"newest\\": *{{'"
        next=$(curl -sk $at | sed -E 's|.*"take": *"([0-9a-f]+)", *"index": *([0-9]+).*|\\1/\\2|')
        curl -sfk $at/public/$next > /dev/null
        wait_for grep -q "/public/$next .* 200 " /var/log/nginx/posecast.log
        before=$(LC_ALL=C date -d '1 minute ago' '+%d/%b/%Y:%H:%M')
        line=$(grep "/public/$next .* 200 " /var/log/nginx/posecast.log | sed "s|\\[[^:]*:..:..|[$before|")
        for _ in $(seq 45); do echo "$line" >> /var/log/nginx/posecast.log; done
        {count}"""
    )
    assert said.splitlines()[-1] == str(45 * 4 // 60)
