"""How a relay is reached: which proxy, and what it answers."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import suppress

import pytest
from posecast_edge.uplink.route import (
    HEAD_BYTES_MAX,
    Proxy,
    ProxyError,
    RelayRoute,
    make_route,
    needs_no_proxy,
    parse_proxy,
)

RELAY = "tls/robots.lab.example:443"
CAMPUS = Proxy("proxy.example", 3128)
SECRET = "s3cret"


@pytest.mark.parametrize(
    ("text", "proxy"),
    [
        ("http://proxy.example:3128", CAMPUS),
        ("proxy.example:3128", CAMPUS),
        ("http://proxy.example:3128/", CAMPUS),
        ("http://proxy.example", Proxy("proxy.example", 80)),
        ("http://[fd77::1]:3128", Proxy("fd77::1", 3128)),
        ("http://me:a%40b%3Ac@proxy.example:3128", Proxy("proxy.example", 3128, "me:a@b:c")),
        ("http://me@proxy.example:3128", Proxy("proxy.example", 3128, "me:")),
    ],
)
def test_proxies(text: str, proxy: Proxy) -> None:
    assert parse_proxy(text) == proxy


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (f"https://me:{SECRET}@proxy.example", "'https' proxies can't be used, only http:// ones"),
        (f"socks5://me:{SECRET}@proxy.example", "'socks5' proxies can't be used"),
        (f"http://me:{SECRET}@proxy.example:{SECRET}", "not a proxy such as http://"),
        (f"http://me:{SECRET}@proxy.example:99999", "not a proxy such as http://"),
        (f"http://me:{SECRET}@", "not a proxy such as http://"),
        (f"http://me:{SECRET}@a b", "not a proxy such as http://"),
        ("http://[::1", "not a proxy such as http://"),
        ("", "not a proxy such as http://"),
    ],
)
def test_no_proxies(text: str, says: str) -> None:
    with pytest.raises(ValueError, match=says) as e:
        parse_proxy(text)
    assert SECRET not in str(e.value)


def test_a_login_is_shown_nowhere() -> None:
    route = RelayRoute(RELAY, None, parse_proxy(f"http://me:{SECRET}@proxy.example:3128"))
    assert SECRET not in f"{route} {route!r} {route.proxy}"
    assert str(route) == f"{RELAY} through the proxy proxy.example:3128"


@pytest.mark.parametrize(
    ("host", "no_proxy", "direct"),
    [
        ("robots.lab.example", "", False),
        ("robots.lab.example", "lab.example", True),
        ("robots.lab.example", ".lab.example , other", True),
        ("robots.lab.example", "*.lab.example", True),
        ("robots.lab.example", "LAB.example:443", True),
        ("robots.lab.example", "lab.example:7447", False),
        ("robots.lab.example", "b.example", False),
        ("robots.lab.example", "*", True),
        ("robots.lab.example", ",,.", False),
        ("10.1.2.3", "10.0.0.0/8", True),
        ("10.1.2.3", "10.1.2.3:443", True),
        ("10.1.2.3", "10.1.2.4, 3", False),
        ("fd77::1", "fd77::/64", True),
        ("fd77::1", "[fd77::1]:443", True),
        ("127.0.0.9", "", True),
        ("::1", "", True),
        ("localhost", "", True),
    ],
)
def test_who_is_reached_without_a_proxy(host: str, no_proxy: str, direct: bool) -> None:
    assert needs_no_proxy(host, 443, no_proxy) is direct


@pytest.mark.parametrize(
    ("endpoint", "proxy", "environment", "route"),
    [
        (RELAY, None, {}, RelayRoute(RELAY)),
        (RELAY, None, {"HTTPS_PROXY": "proxy.example:3128"}, RelayRoute(RELAY, None, CAMPUS)),
        (
            RELAY,
            None,
            {"https_proxy": "proxy.example:3128", "HTTPS_PROXY": "x:1"},
            RelayRoute(RELAY, None, CAMPUS),
        ),
        (RELAY, None, {"ALL_PROXY": "proxy.example:3128"}, RelayRoute(RELAY, None, CAMPUS)),
        (RELAY, None, {"HTTPS_PROXY": "x:1", "no_proxy": "lab.example"}, RelayRoute(RELAY)),
        (RELAY, CAMPUS, {"HTTPS_PROXY": "x:1", "NO_PROXY": "*"}, RelayRoute(RELAY, None, CAMPUS)),
        ("tcp/127.0.0.1:1", CAMPUS, {"HTTPS_PROXY": "x:1"}, RelayRoute("tcp/127.0.0.1:1")),
        ("tls/127.0.0.1:1", None, {"HTTPS_PROXY": "x:1"}, RelayRoute("tls/127.0.0.1:1")),
    ],
)
def test_which_proxy_is_used(
    endpoint: str, proxy: Proxy | None, environment: dict[str, str], route: RelayRoute
) -> None:
    assert make_route(endpoint, None, proxy, environment) == route


@pytest.mark.parametrize(
    ("endpoint", "value", "says"),
    [
        (
            "quic/robots.lab.example:443",
            "http://p",
            "only a relay at tls/HOST:PORT is reached through a proxy",
        ),
        ("tcp/10.0.0.5:7447", "http://p", "only a relay at tls/HOST:PORT is reached through a proxy"),
        (RELAY, f"socks5://me:{SECRET}@p", "'socks5' proxies can't be used, only http:// ones"),
    ],
)
def test_a_proxy_of_the_environment_that_is_not_used_is_named(
    endpoint: str, value: str, says: str, caplog: pytest.LogCaptureFixture
) -> None:
    assert make_route(endpoint, None, None, {"HTTPS_PROXY": value}) == RelayRoute(endpoint)
    assert [r.getMessage() for r in caplog.records] == [f"HTTPS_PROXY is not used: {says}"]


@pytest.mark.parametrize("endpoint", ["quic/robots.lab.example:443", "tcp/10.0.0.5:7447"])
def test_a_proxy_and_a_name_need_tls(endpoint: str) -> None:
    with pytest.raises(ValueError, match="a proxy needs a relay at tls/HOST:PORT"):
        make_route(endpoint, None, CAMPUS, {})
    with pytest.raises(ValueError, match="a relay's name needs a relay at tls/HOST:PORT"):
        make_route(endpoint, "robots.lab.example", None, {})


@pytest.fixture
def answers() -> Iterator[list[bytes]]:
    """What a proxy on 127.0.0.1 answers, in turn; its port is the first element until it is replaced."""
    found: list[bytes] = []
    with socket.create_server(("127.0.0.1", 0)) as server:
        found.append(str(server.getsockname()[1]).encode())

        def serve() -> None:
            with suppress(OSError):
                while True:
                    with server.accept()[0] as link, suppress(OSError):
                        link.recv(4096)
                        link.sendall(found[0])
                        link.shutdown(socket.SHUT_WR)
                        link.recv(1)

        threading.Thread(target=serve, daemon=True).start()
        yield found
        server.shutdown(socket.SHUT_RDWR)


@pytest.mark.parametrize(
    ("login", "answer", "is_answer", "says"),
    [
        (None, b"HTTP/1.1 407 x\r\n\r\n", True, r"wants a login: use http://USER:PASSWORD@127\.0\.0\.1:\d+$"),
        (
            "a:b",
            b"HTTP/1.1 407 x\r\nProxy-Authenticate: Basic r\r\n\r\n",
            True,
            "refuses the user or password",
        ),
        (
            None,
            b"HTTP/1.1 407 x\r\nProxy-Authenticate: NTLM\r\nproxy-authenticate: Negotiate\r\n\r\n",
            True,
            "wants a login by NTLM, Negotiate, and only Basic can be used",
        ),
        (
            None,
            b"HTTP/1.0 403 x\r\n\r\n",
            True,
            r"does not allow connections to robots.lab.example:443 \(status 403",
        ),
        (None, b"HTTP/1.1 504 x\r\n\r\n", True, "can't connect to robots.lab.example:443"),
        (None, b"SSH-2.0-x\r\n\r\n", True, "is not an HTTP proxy"),
        (None, b"HTTP/1.1 200 " + b"x" * 2 * HEAD_BYTES_MAX, True, "is not an HTTP proxy"),
        (None, b"", False, "ends the connection"),
    ],
)
def test_what_a_proxy_answers(
    answers: list[bytes], login: str | None, answer: bytes, is_answer: bool, says: str
) -> None:
    port, answers[0] = int(answers[0]), answer
    with pytest.raises(ProxyError, match=says) as e:
        RelayRoute(RELAY, None, Proxy("127.0.0.1", port, login)).connect(20.0)
    assert e.value.is_answer is is_answer
    assert str(e.value).startswith("can't be reached: the proxy 127.0.0.1:")


def test_a_proxy_that_is_not_there() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with pytest.raises(ProxyError, match="accepts connections but sends nothing"):
            RelayRoute(RELAY, None, Proxy("127.0.0.1", port)).connect(0.1)
    for host, says in (
        ("127.0.0.1", "does not answer"),
        ("no.such.invalid", "no.such.invalid is unknown here"),
    ):
        with pytest.raises(ProxyError, match=says) as e:
            RelayRoute(RELAY, None, Proxy(host, port)).connect(20.0)
        assert not e.value.is_answer
