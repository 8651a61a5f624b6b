"""The settings of the agent's Zenoh session: a client of one relay, which discovers nobody else."""

from __future__ import annotations

import base64
import json

import zenoh

from posecast_edge.uplink.certificate import Certificate
from posecast_edge.uplink.credential_file import Proof

OPEN_MS = 2000  # one attempt; between attempts the thread checks whether to stop
LEASE_MS = 2500  # after this long without a sign of life, the relay considers the agent gone
RETRY_MS = (
    25,
    1000,
)  # first and longest; quick at first: a relay that adds a robot reopens within milliseconds
BATCH_BYTES = 8192  # small batches and a small kernel buffer: on a slow uplink a queue only adds delay
SNDBUF_BYTES = 32768
HEARD_BYTES_MAX = 1 << 18  # per message to the agent, which receives only queries and echoes


def make_zenoh_config(relay: str, credential: Proof | None = None, tries_once: bool = False) -> zenoh.Config:
    """A Zenoh client that connects only to this relay and discovers nobody else. `relay`: an endpoint,
    `tcp/host:port`. `tries_once`: try to connect once, instead of repeatedly for OPEN_MS."""
    link: dict[str, object] = {
        "tx": {"lease": LEASE_MS, "keep_alive": 4, "batch_size": BATCH_BYTES},
        "rx": {"max_message_size": HEARD_BYTES_MAX},
    }
    auth: dict[str, object] = {}
    if isinstance(credential, Certificate):
        own = {"connect_certificate": str(credential.chain), "connect_private_key": str(credential.key)}
        ca_file = {} if credential.ca is None else {"root_ca_certificate": str(credential.ca)}
        link["tls"] = {"enable_mtls": True, **own, **ca_file}
    elif credential is not None:
        auth["usrpwd"] = {"user": credential.robot, "password": credential.secret}
        if credential.ca is not None:  # otherwise the public authorities
            ca = base64.b64encode(credential.ca.encode()).decode()
            link["tls"] = {"root_ca_certificate_base64": ca}
    endpoint = relay if relay.startswith("quic/") else f"{relay}#so_sndbuf={SNDBUF_BYTES}"
    first_ms = OPEN_MS if tries_once else RETRY_MS[0]
    retry = {"period_init_ms": first_ms, "period_max_ms": RETRY_MS[1], "period_increase_factor": 2}
    return zenoh.Config.from_json5(
        json.dumps(
            {
                "mode": "client",
                "connect": {"endpoints": [endpoint], "timeout_ms": OPEN_MS, "retry": retry},
                "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
                "transport": {"link": link, "auth": auth, "shared_memory": {"enabled": False}},
            }
        )
    )
