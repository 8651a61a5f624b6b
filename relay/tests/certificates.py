"""Certificates of the tests' own."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

KEY = "-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes"


def certificates(folder: Path, name: str = "server", host: str = "IP:127.0.0.1") -> None:
    """An authority `ca.pem`, and a certificate of it: `NAME.pem`, `NAME.key`. Skips without openssl."""
    if shutil.which("openssl") is None:
        pytest.skip("no openssl here")
    (folder / "names").write_text(f"subjectAltName={host}\nbasicConstraints=CA:FALSE\n")
    for words in (
        f"req -x509 {KEY} -days 2 -subj /CN=authority -keyout ca.key -out ca.pem",
        f"req {KEY} -subj /CN={name} -keyout {name}.key -out asked.pem",
        f"x509 -req -in asked.pem -CA ca.pem -CAkey ca.key -set_serial 2 -extfile names -out {name}.pem",
    ):
        subprocess.run(["openssl", *words.split()], cwd=folder, check=True, capture_output=True)
