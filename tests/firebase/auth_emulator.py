"""The Auth emulator of firebase-tools; and accounts in it, over its REST API.

python -m tests.firebase.auth_emulator      prints `http://127.0.0.1:PORT`, or `not here: WHY`; until SIGTERM
"""

from __future__ import annotations

import signal
import sys
import tempfile
from pathlib import Path
from typing import Any

import httpx

from tests.firebase.emulator import PROJECT, Emulator, NotHere

__all__ = ["PROJECT", "AuthEmulator", "NotHere"]


class AuthEmulator(Emulator):
    """NotHere if it can't be installed."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, "auth")

    def _ask(self, what: str, body: dict[str, Any], by_owner: bool = False) -> dict[str, Any]:
        answer = httpx.post(
            f"http://{self.host}/identitytoolkit.googleapis.com/v1/accounts:{what}?key=none",
            json=body,
            headers={"authorization": "Bearer owner"} if by_owner else {},
            trust_env=False,
            timeout=10,
        )
        answer.raise_for_status()
        found: dict[str, Any] = answer.json()
        return found

    def sign_up(self, email: str, password: str = "open-sesame") -> dict[str, Any]:
        """A new account: `idToken`, `localId`, `refreshToken`."""
        return self._ask("signUp", {"email": email, "password": password, "returnSecureToken": True})

    def change(self, account: str, **to: object) -> None:
        """As an administrator: `disableUser`, `validSince` (unix seconds as text)."""
        self._ask("update", {"localId": account} | to, by_owner=True)


def main() -> None:
    """For tests in other languages."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    with tempfile.TemporaryDirectory() as folder:
        try:
            made = AuthEmulator(Path(folder))
        except NotHere as e:
            print(f"not here: {' '.join(str(e).split())}", flush=True)
            return
        try:
            print(f"http://{made.host}", flush=True)
            signal.pause()
        finally:
            made.stop()


if __name__ == "__main__":
    main()
