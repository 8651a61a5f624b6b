"""How to reach a relay: its endpoint, the name in its certificate and the HTTP proxy on the way."""

from __future__ import annotations

import base64
import ipaddress
import logging
import re
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import unquote, urlsplit

from posecast_edge.kit import quote

log = logging.getLogger("posecast_edge.link")

ENDPOINT = re.compile(r"(tcp|tls|quic)/(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})")
HOST = re.compile(r"[A-Za-z0-9._:-]{1,253}")
PROXY_VARIABLES = ("https_proxy", "HTTPS_PROXY", "all_proxy", "ALL_PROXY")  # the first that is set counts
HEAD_BYTES_MAX = 16384  # of the proxy's answer


def check_endpoint(text: str) -> str:
    """Return `text` if it is a relay's endpoint, `tcp/HOST:PORT`. Raises ValueError, one line, otherwise."""
    match = ENDPOINT.fullmatch(text)
    if not match or not 0 < int(match[3]) < 65536:
        raise ValueError(f"{quote(text)} is not an endpoint such as tcp/127.0.0.1:7447")
    return text


def check_server_name(text: str) -> str:
    """Return `text` if it can be the name in a certificate. Raises ValueError, one line, otherwise."""
    if not HOST.fullmatch(text):
        raise ValueError(f"{quote(text)} is not a name such as robots.example.org")
    return text


class ProxyError(OSError):
    """The proxy did not open the connection. Its text is the rest of a sentence about the relay.
    `is_answer`: the proxy has answered, so asking it again soon is of no use."""

    def __init__(self, text: str, is_answer: bool) -> None:
        super().__init__(text)
        self.is_answer = is_answer


@dataclass(frozen=True)
class Proxy:
    """An HTTP proxy that opens connections (CONNECT). `login`: USER:PASSWORD, never shown."""

    host: str
    port: int
    login: str | None = field(default=None, repr=False)

    def __str__(self) -> str:
        return f"{_bracket(self.host)}:{self.port}"


def parse_proxy(text: str) -> Proxy:
    """Read http://[USER:PASSWORD@]HOST[:PORT]. Raises ValueError, one line that never holds the login."""
    such = "not a proxy such as http://proxy.example:3128"
    try:
        parts = urlsplit(text if "://" in text else f"http://{text}")
        host, port = parts.hostname, parts.port
    except ValueError:  # its message may quote the login
        raise ValueError(such) from None
    if parts.scheme != "http":
        raise ValueError(f"{quote(parts.scheme)} proxies can't be used, only http:// ones")
    if not host or not HOST.fullmatch(host) or port == 0:
        raise ValueError(such)
    login = None
    if parts.username is not None:
        login = f"{unquote(parts.username)}:{unquote(parts.password or '')}"
    return Proxy(host, port or 80, login)


def needs_no_proxy(host: str, port: int, no_proxy: str) -> bool:
    """Whether `no_proxy`, the value of NO_PROXY, or the host being this machine means a direct connection.
    Entries: names, which include their subdomains, addresses, networks such as 10.0.0.0/8, each with an
    optional port, or *."""
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        address = None
    if host.lower() == "localhost" or (address is not None and address.is_loopback):
        return True
    return any(
        _covers(entry.strip().lower(), host.lower(), port, address)
        for entry in no_proxy.split(",")
        if entry.strip()
    )


def _covers(
    entry: str, host: str, port: int, address: ipaddress.IPv4Address | ipaddress.IPv6Address | None
) -> bool:
    if entry == "*":
        return True
    if address is not None:
        try:
            return address in ipaddress.ip_network(entry.strip("[]"), strict=False)
        except ValueError:
            pass
    name, _, own_port = entry.rpartition(":") if re.search(r":[0-9]+$", entry) else (entry, "", "")
    name = name.strip("[]").removeprefix("*").removeprefix(".")
    if own_port and int(own_port) != port:
        return False
    return bool(name) and (host == name or (address is None and host.endswith(f".{name}")))


@dataclass(frozen=True)
class RelayRoute:
    """How to reach a relay. `endpoint`: its Zenoh endpoint, such as `tls/HOST:PORT`; `server_name`: the name
    that its certificate must have, None for HOST; `proxy`: the proxy that opens the connection, None for a
    direct one."""

    endpoint: str
    server_name: str | None = None
    proxy: Proxy | None = None

    def __str__(self) -> str:
        return self.endpoint if self.proxy is None else f"{self.endpoint} through the proxy {self.proxy}"

    @property
    def scheme(self) -> str:
        """tcp, tls or quic."""
        return self.endpoint.partition("/")[0]

    @property
    def address(self) -> tuple[str, int]:
        """Host and port."""
        host, _, port = self.endpoint.partition("/")[2].rpartition(":")
        return host.strip("[]"), int(port)

    @property
    def expected_name(self) -> str:
        """The name that the relay's certificate must have."""
        return self.server_name or self.address[0]

    @property
    def needs_tunnel(self) -> bool:
        """Whether Zenoh can't connect on its own: it knows no proxies, and no name apart from the address."""
        return self.proxy is not None or self.server_name is not None

    def connect(self, timeout_s: float) -> socket.socket:
        """Open a TCP connection to the relay; each of the steps may take `timeout_s`. Raises ProxyError when
        the proxy does not do it, OSError when the relay does not answer, and UnicodeError for an invalid host
        name."""
        host, port = self.address
        if self.proxy is None:
            return socket.create_connection((host, port), timeout_s)
        try:
            link = socket.create_connection((self.proxy.host, self.proxy.port), timeout_s)
        except socket.gaierror:
            raise ProxyError(
                f"can't be reached: the proxy's name {self.proxy.host} is unknown here", is_answer=False
            ) from None
        except (OSError, UnicodeError):
            raise ProxyError(
                f"can't be reached: the proxy {self.proxy} does not answer", is_answer=False
            ) from None
        try:
            _ask_proxy(link, self.proxy, f"{_bracket(host)}:{port}", timeout_s)
        except BaseException:
            link.close()
            raise
        return link


def make_route(
    endpoint: str, server_name: str | None, proxy: Proxy | None, environment: Mapping[str, str]
) -> RelayRoute:
    """The route for what the user gave; without a `proxy`, through the environment's. Logs why that one is
    not used. Raises ValueError, one line, when the parts don't fit together."""
    route = RelayRoute(endpoint, server_name, proxy)
    no_proxy = environment.get("no_proxy") or environment.get("NO_PROXY", "")
    is_near = needs_no_proxy(*route.address, no_proxy)
    if route.scheme == "tcp" and is_near:  # variables for the usual relay do not concern one on this machine
        return RelayRoute(endpoint)
    for given, what in ((proxy, "a proxy"), (server_name, "a relay's name")):
        if given is not None and route.scheme != "tls":
            raise ValueError(f"{what} needs a relay at tls/HOST:PORT, not {endpoint}")
    variable = next((name for name in PROXY_VARIABLES if environment.get(name)), None)
    if proxy is not None or variable is None or is_near:
        return route
    if route.scheme != "tls":
        log.warning("%s is not used: only a relay at tls/HOST:PORT is reached through a proxy", variable)
        return route
    try:
        return RelayRoute(endpoint, server_name, parse_proxy(environment[variable]))
    except ValueError as e:
        log.warning("%s is not used: %s", variable, e)
        return route


def _bracket(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _ask_proxy(link: socket.socket, proxy: Proxy, target: str, timeout_s: float) -> None:
    """Let the proxy connect `link` to `target`. Raises ProxyError."""
    login = ""
    if proxy.login is not None:
        login = f"Proxy-Authorization: Basic {base64.b64encode(proxy.login.encode()).decode()}\r\n"
    head, until_s = b"", time.monotonic() + timeout_s
    try:
        link.sendall(f"CONNECT {target} HTTP/1.1\r\nHost: {target}\r\n{login}\r\n".encode())
        while not head.endswith(b"\r\n\r\n"):
            link.settimeout(max(0.001, until_s - time.monotonic()))
            byte = link.recv(1)  # not one more: what follows is the relay's
            if not byte or len(head) >= HEAD_BYTES_MAX:
                break
            head += byte
    except TimeoutError:
        raise ProxyError(
            f"can't be reached: the proxy {proxy} accepts connections but sends nothing", is_answer=False
        ) from None
    except OSError:
        raise ProxyError(
            f"can't be reached: the proxy {proxy} ends the connection", is_answer=False
        ) from None
    link.settimeout(timeout_s)
    match = re.match(rb"HTTP/1\.[01] ([0-9]{3})", head) if head.endswith(b"\r\n\r\n") else None
    if match is None:
        what = "is not an HTTP proxy" if head else "ends the connection"
        raise ProxyError(f"can't be reached: the proxy {proxy} {what}", is_answer=bool(head))
    status = int(match[1])
    if not 200 <= status < 300:
        raise ProxyError(f"can't be reached: {_explain_status(status, head, proxy, target)}", is_answer=True)


def _explain_status(status: int, head: bytes, proxy: Proxy, target: str) -> str:
    if status == 407:
        offers = re.findall(rb"(?im)^proxy-authenticate: *([a-z]+)", head)
        if offers and all(offer.lower() != b"basic" for offer in offers):
            named = ", ".join(sorted({offer.decode() for offer in offers}))
            return f"the proxy {proxy} wants a login by {named}, and only Basic can be used"
        if proxy.login is None:
            return f"the proxy {proxy} wants a login: use http://USER:PASSWORD@{proxy}"
        return f"the proxy {proxy} refuses the user or password in its URL"
    if status in (502, 503, 504):
        return f"the proxy {proxy} can't connect to {target} (status {status})"
    return f"the proxy {proxy} does not allow connections to {target} (status {status})"
