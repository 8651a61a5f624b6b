"""The certificate of a robot, for a relay that requires mutual TLS instead of a password."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Certificate:
    """Paths of PEM files. Zenoh reads them again for every connection, so they may be renewed in place.

    `chain`: the robot's certificate, followed by the intermediate ones. `ca`: the authority that signed the
    relay's certificate; None for one that browsers trust.
    """

    chain: Path
    key: Path
    ca: Path | None = None

    def check(self) -> None:
        """Raise ValueError with one line when the files can't be used."""
        import ssl  # noqa: PLC0415 - over 1 MB, not needed without a certificate

        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        try:
            context.load_cert_chain(self.chain, self.key, password="")
        except OSError as e:  # SSLError is one
            why = (
                "not a certificate and its key"
                if isinstance(e, ssl.SSLError)
                else (e.strerror or str(e)).lower()
            )
            raise ValueError(f"{self.chain}, {self.key}: {why}") from None
        if self.key.stat().st_mode & 0o007:
            raise ValueError(f"{self.key}: readable by everybody on this machine: chmod 600 it")
        if self.ca is None:
            return
        try:
            context.load_verify_locations(self.ca)
        except OSError as e:
            why = "not a certificate" if isinstance(e, ssl.SSLError) else (e.strerror or str(e)).lower()
            raise ValueError(f"{self.ca}: {why}") from None
