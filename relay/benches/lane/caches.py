"""The cache nodes of the lane's bench: nginx and Varnish, each before an origin."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from posecast_testing import free_port

from relay.benches.build import ROOT
from relay.benches.servers import CannotStart, Place, start_on, wait_port

START_LIMIT_S = 20.0
HOSTING = ROOT / "infra" / "hosting"
RULES, VCL = (
    HOSTING / "nginx-lane.rules",
    HOSTING / "varnish.vcl",
)  # what a reader of docs/how-to/scale/cache-for-a-crowd.md uses
NGINX = """
worker_processes 1;
worker_rlimit_nofile 20000;
daemon off;
pid {folder}/nginx.pid;
error_log stderr warn;
events {{ worker_connections 16384; }}
http {{
	access_log off;
	client_body_temp_path {folder}/body;
	proxy_temp_path {folder}/proxy;
	fastcgi_temp_path {folder}/fastcgi;
	uwsgi_temp_path {folder}/uwsgi;
	scgi_temp_path {folder}/scgi;
	proxy_cache_path {folder}/cache levels=1:2 keys_zone=posecast_lane:16m max_size=256m use_temp_path=off;
	limit_req_zone $binary_remote_addr zone=posecast_crowd:10m rate=5000r/s;
	upstream posecast_relay {{ server {origin}; keepalive 16; keepalive_timeout 4s; }}
	server {{
		listen 127.0.0.1:{port} backlog=4096;
		server_tokens off;
		set $lane_relay http://posecast_relay;
		set $lane_host {origin};
		set $lane_for $remote_addr;
		include {rules};
	}}
}}
"""


@dataclass(frozen=True)
class CacheNode:
    """A cache that answers on `port` of 127.0.0.1. `origin_host`: the address at which it asks the origin."""

    name: str
    port: int
    pid: int
    origin_host: str


@contextmanager
def start_nginx(origin: str, place: Place) -> Iterator[CacheNode]:
    """nginx before `origin` (host:port). CannotStart."""
    with _make_folder() as folder:
        port, file = free_port(), folder / "nginx.conf"
        file.write_text(NGINX.format(folder=folder, origin=origin, port=port, rules=RULES))
        command = [_find("nginx"), "-c", str(file), "-e", "stderr"]
        with _started(place, port, command) as pid:
            yield CacheNode("nginx", port, pid, origin.partition(":")[0])


@contextmanager
def start_varnish(origin: str, place: Place) -> Iterator[CacheNode]:
    """Varnish before `origin` (host:port). CannotStart."""
    host, _, origin_port = origin.partition(":")
    with _make_folder() as folder:
        port, file = free_port(), folder / "lane.vcl"
        text = re.sub(r'\.host = "[^"]*"', f'.host = "{host}"', VCL.read_text())
        file.write_text(re.sub(r'\.port = "[^"]*"', f'.port = "{origin_port}"', text))
        command = [_find("varnishd"), "-F", "-n", str(folder / "varnish"), "-f", str(file), "-T", "none"]
        command += ["-a", f"127.0.0.1:{port}", "-s", "malloc,128m", "-p", "timeout_idle=75"]
        with _started(place, port, command) as pid:
            yield CacheNode("Varnish", port, pid, host)


CACHES = {"nginx": start_nginx, "Varnish": start_varnish}


@contextmanager
def _make_folder() -> Iterator[Path]:
    """A folder that servers which give up root's rights can reach."""
    with TemporaryDirectory(prefix="posecast-lane-") as name:
        folder = Path(name)
        folder.chmod(0o755)
        yield folder


def _find(program: str) -> str:
    found = shutil.which(program) or shutil.which(program, path="/usr/sbin:/usr/local/sbin")
    if found is None:
        raise CannotStart(f"needs {program}; on Debian: apt-get install {program.removesuffix('d')}")
    return found


@contextmanager
def _started(place: Place, port: int, command: list[str]) -> Iterator[int]:
    """Its process, once it takes connections. CannotStart."""
    child = start_on(place, place.other_core, Path(command[0]).name, *command)
    try:
        wait_port(port)
        yield child.process.pid
    finally:
        child.stop()  # so that its workers end, too
