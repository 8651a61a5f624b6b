"""Reads the router's certificate and the authority for robots, and keeps the last valid versions."""

from __future__ import annotations

import base64
import json
import logging
import ssl
from pathlib import Path
from typing import Any

import zenoh

log = logging.getLogger("posecast_relay")

FILE_BYTES_MAX = 1 << 20
TLS = "transport/link/tls"  # prefix of Zenoh's settings


class CertificateError(ValueError):
    """A certificate file can't be used. The message is one line that names it."""


class RouterCertificates:
    """The content of `--zenoh-tls-cert`, `--zenoh-tls-key` and `--zenoh-ca` when all were last valid.

    Zenoh gets the bytes, not the files, so that a file damaged meanwhile can't prevent a new session.
    """

    def __init__(self, cert: Path | None, key: Path | None, ca: Path | None) -> None:
        """Raises CertificateError if a file can't be used."""
        self._cert, self._key, self._ca = cert, key, ca
        self._kept: dict[str, bytes] = {}
        self._kept = self._read()
        self.trouble: str | None = None  # the files' present problem

    def refresh(self) -> bool:
        """Read the files again. Return whether they have changed and are valid. Otherwise the last valid
        content is kept.
        """
        try:
            read = self._read()
        except CertificateError as e:
            if str(e) != self.trouble:
                log.warning("%s; the last good certificates stay in force", e)
            self.trouble = str(e)
            return False
        if self.trouble is not None:
            self.trouble = None
            log.warning("certificates are valid again")
        is_new = read != self._kept
        self._kept = read
        return is_new

    def make_settings(self) -> dict[str, Any]:
        """Return Zenoh's settings with these certificates."""
        return _make_settings(self._kept)

    def _read(self) -> dict[str, bytes]:
        """Read and check all files, by their names in Zenoh's settings. Raises CertificateError."""
        found: dict[str, bytes] = {}
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        if self._cert is not None and self._key is not None:
            found["listen_certificate"] = _read_file("--zenoh-tls-cert", self._cert)
            found["listen_private_key"] = _read_file("--zenoh-tls-key", self._key)
            try:
                context.load_cert_chain(self._cert, self._key, password="")
            except OSError:  # ssl.SSLError is one
                raise CertificateError(
                    f"--zenoh-tls-cert {self._cert}, --zenoh-tls-key {self._key}: not a valid pair"
                ) from None
        if self._ca is not None:
            found["root_ca_certificate"] = _read_file("--zenoh-ca", self._ca)
            try:
                context.load_verify_locations(self._ca)
            except OSError:
                raise CertificateError(f"--zenoh-ca {self._ca}: no certificate in PEM form") from None
        if found != self._kept and "listen_certificate" in found:
            try:
                _try_out(found)
            except zenoh.ZError as e:  # it knows fewer kinds of keys than Python: no P-521
                why = str(e).splitlines()[0].partition(" at /")[0]
                raise CertificateError(
                    f"--zenoh-tls-cert {self._cert}, --zenoh-tls-key {self._key}: Zenoh can't use them: {why}"
                ) from None
        return found


def _make_settings(certificates: dict[str, bytes]) -> dict[str, Any]:
    return {f"{TLS}/{name}_base64": base64.b64encode(data).decode() for name, data in certificates.items()}


def _try_out(certificates: dict[str, bytes]) -> None:
    """Listen with these certificates for some milliseconds, on a port of this machine. Raises ZError."""
    config = zenoh.Config()
    settings: dict[str, Any] = {
        "mode": "router",
        "listen/endpoints": ["tls/127.0.0.1:0"],
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,
        "transport/shared_memory/enabled": False,
        f"{TLS}/enable_mtls": "root_ca_certificate" in certificates,
        **_make_settings(certificates),
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    zenoh.open(config).close()  # type: ignore[no-untyped-call]


def _read_file(flag: str, path: Path) -> bytes:
    try:
        if not path.is_file():
            path.stat()  # raises if there is nothing
            raise CertificateError(f"{flag} {path}: is not a file")
        with path.open("rb") as file:
            return file.read(FILE_BYTES_MAX)
    except OSError as e:
        raise CertificateError(f"{flag} {path}: {(e.strerror or str(e)).lower()}") from None
