"""`make demo`: a relay and the demo robot on this machine; Ctrl-C ends both.

Environment: PORT (8080), HOST (127.0.0.1; 0.0.0.0 prints a link and a QR code for the phone in your hand).
"""

from __future__ import annotations

import errno
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BIN = ROOT / ".venv" / "bin"
ROBOT = "demo"
UPLINK = "tcp/127.0.0.1:7447"  # the default, so that a second robot can join by the README's line
START_LIMIT_S = 30.0


def lan_address() -> str:
    """The address other machines reach this one by: the route's own source address, nothing is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # TEST-NET-1: only picks a route
            return str(probe.getsockname()[0])
        except OSError:
            return "127.0.0.1"


def answers(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=1) as answer:
            return bool(answer.status == 200)
    except (urllib.error.URLError, OSError):
        return False


def wait_for(url: str, children: list[subprocess.Popen[bytes]]) -> bool:
    deadline = time.monotonic() + START_LIMIT_S
    while time.monotonic() < deadline:
        answered = answers(url)
        if any(child.poll() is not None for child in children):
            return False  # what answered, if anything did, is somebody else's
        if answered:
            return True
        time.sleep(0.1)
    return False


def announce(url: str, *, qr: bool) -> None:
    print(f"\n  Posecast is on air:  {url}\n", flush=True)
    if qr:
        import segno  # noqa: PLC0415 - only for the phone

        segno.make(url).terminal(compact=True)
    print("  Ctrl-C ends it.", flush=True)


def is_taken(host: str, port: str) -> bool:
    """Whether something listens there already: what answers would be its robot, not ours."""
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, int(port)))
        except OSError as e:
            return e.errno == errno.EADDRINUSE
        except (ValueError, OverflowError):
            return False  # the relay says what is wrong with it
    return False


def end(children: list[subprocess.Popen[bytes]]) -> None:
    for child in reversed(children):
        if child.poll() is None:
            child.terminate()
    for child in reversed(children):
        try:
            child.wait(timeout=5)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()


def stop(_signum: int, _frame: object) -> None:
    raise KeyboardInterrupt


def main(arguments: list[str]) -> int:
    host, port = os.environ.get("HOST", "127.0.0.1"), os.environ.get("PORT", "8080")
    relay: list[str | Path] = [BIN / "posecast-relay", "run", "--dev", "--host", host, "--port", port]
    relay += ["--zenoh-listen", UPLINK, "--metrics-port", "0", "--static", ROOT / "spa" / "dist"]
    edge: list[str | Path] = [
        BIN / "posecast-edge",
        "run",
        "--robot",
        ROBOT,
        "--source",
        "demo",
        "--relay",
        UPLINK,
    ]
    if is_taken(host, port):
        print(
            f"Port {port} is taken: end what listens there, or give another one: PORT=8081 make demo",
            file=sys.stderr,
        )
        return 2
    local = f"http://127.0.0.1:{port}"
    for ending in (signal.SIGINT, signal.SIGTERM):  # also where a shell had SIGINT ignored
        signal.signal(ending, stop)
    children: list[subprocess.Popen[bytes]] = []
    try:
        # own sessions, so that a Ctrl-C reaches only this script, which then ends them in order
        children.append(subprocess.Popen(relay, start_new_session=True))
        on_air = wait_for(f"{local}/livez", children)
        if on_air:
            children.append(subprocess.Popen(edge, start_new_session=True))
            on_air = wait_for(f"{local}/api/v1/robots/{ROBOT}/state", children)
        if not on_air:
            print("The demo did not come on air; see the line above.", file=sys.stderr)
            return 2
        if "--vite" in arguments:
            environment = {**os.environ, "POSECAST_RELAY": local}
            vite = ["npx", "--no-install", "vite", "--port", "5173"]
            children.append(subprocess.Popen(vite, cwd=ROOT / "spa", start_new_session=True, env=environment))
            announce(f"http://127.0.0.1:5173/#/r/{ROBOT}", qr=False)
        else:
            shown = lan_address() if host == "0.0.0.0" else host
            announce(f"http://{shown}:{port}/#/r/{ROBOT}", qr=host == "0.0.0.0")
        while all(child.poll() is None for child in children):
            time.sleep(0.2)
        return 1
    except KeyboardInterrupt:
        return 0
    finally:
        end(children)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
