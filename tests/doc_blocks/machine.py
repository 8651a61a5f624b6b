"""A private machine: it has its own /etc, /srv, /var and network, so commands that change them are typed as
they are on the pages. All of it is gone when the script ends. Linux and root only.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.conftest import BIN
from tests.doc_blocks.block import ROOT

ISOLATED = ("unshare", "--mount", "--net", "--pid", "--fork", "--kill-child", "--mount-proc")
PRELUDE = """
mkdir etc && cp -a /etc/. etc && mount --bind etc /etc
for folder in /srv /var/lib /var/log /var/cache /run; do mount -t tmpfs tmpfs $folder; done
mkdir -p /srv/posecast /var/log/nginx /var/lib/nginx /etc/systemd/system
ip link set lo up
shopt -s expand_aliases
wait_for() {
  for _ in $(seq 900); do if "$@" > out 2>&1; then return; fi; sleep 0.1; done
  cat out ./*.log >&2; return 1
}
"""
# What a container lacks. `runuser`: the tests' Python may be in a folder that only root reads.
STAND_INS = {
    "sudo": 'exec "$@"',
    "runuser": '[ "$1" = -u ] && id "$2" > /dev/null && [ "$3" = -- ] && shift 3 && exec "$@"',
    "systemctl": """[ "$1" = daemon-reload ] && exit
[ "$1 $2" = "enable --now" ] && ls "/etc/systemd/system/$(echo "$3" | sed 's/@.*/@/').service\"""",
    "journalctl": 'cat "$(echo "${@: -1}" | sed "s/@.*//").log"',
}


class Machine:
    """Runs scripts, each on a new machine, in `folder` with the checkout's `infra`."""

    def __init__(self, folder: Path) -> None:
        if subprocess.run([*ISOLATED, "true"], capture_output=True, check=False).returncode:
            pytest.skip("no private mounts and network here: they need Linux and root")
        self.folder = folder
        (folder / "infra").symlink_to(ROOT / "infra")
        (folder / "bin").mkdir()
        for name, script in STAND_INS.items():
            (folder / "bin" / name).write_text(f"#!/bin/bash\n{script}\n")
            (folder / "bin" / name).chmod(0o755)

    def run(self, script: str, variables: Mapping[str, str] | None = None) -> str:
        """To its end; what it printed on stdout."""
        path = f"{self.folder}/bin:{BIN}:/usr/sbin:/sbin:{os.environ['PATH']}"
        done = subprocess.run(
            [*ISOLATED, "bash", "-euc", PRELUDE + script.replace("/opt/posecast/bin", str(BIN))],
            cwd=self.folder,
            env={**os.environ, "PATH": path, **(variables or {})},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert done.returncode == 0, f"{script}\n{done.stdout}{done.stderr}"
        return done.stdout
