"""The relay understands the settings in infra/cloud, and they restrict it as compose does. Nothing in it is
started here."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from posecast_relay.config.settings import FLAGS, parse
from posecast_relay.server.http_server import END_S

from tests.doc_blocks.block import read_blocks

pytestmark = pytest.mark.docs

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs/how-to/install/cloud.md").read_text(encoding="utf-8")
CLOUD = ROOT / "infra/cloud"
BASE = CLOUD / "kubernetes"
POD_KINDS = ("Deployment",)
VARIABLES = {flag.variable for flag in FLAGS}


def documents(file: Path) -> list[dict[str, Any]]:
    """All of a file."""
    return [doc for doc in yaml.safe_load_all(file.read_text()) if doc]


ALL = [doc for file in sorted(BASE.glob("*.yaml")) for doc in documents(file)]
PODS = {doc["metadata"]["name"]: doc["spec"]["template"]["spec"] for doc in ALL if doc["kind"] in POD_KINDS}
RUN = documents(CLOUD / "run.yaml")[0]["spec"]["template"]


def settings(container: dict[str, Any], **files: str) -> Any:
    """What the relay makes of the container's variables."""
    told = {each["name"]: each.get("value", "redis://:word@redis:6379") for each in container["env"]}
    assert told.keys() <= VARIABLES
    assert container["command"] == ["posecast-relay", "run"]
    return parse(["run"], told | files)


def test_every_file_is_in_the_base() -> None:
    (base,) = documents(BASE / "kustomization.yaml")
    assert sorted([*base["resources"], "kustomization.yaml"]) == sorted(f.name for f in BASE.glob("*.yaml"))


def test_the_relay_understands_what_it_is_told() -> None:
    here = dict.fromkeys(("POSECAST_ROBOTS", "POSECAST_ZENOH_TLS_CERT", "POSECAST_ZENOH_TLS_KEY"), __file__)
    for name, role in (("ingest", "ingest"), ("gateway", "gateway")):
        (container,) = PODS[name]["containers"]
        found = settings(container, **here)
        assert (found.role, found.host, found.metrics_port) == (role, "0.0.0.0", 9100)
        ports = {port["name"]: port["containerPort"] for port in container["ports"]}
        assert (ports["http"], ports["metrics"]) == (found.port, found.metrics_port)
    (container,) = RUN["spec"]["containers"]
    found = settings(container, POSECAST_ROBOTS=__file__)
    assert found.role == "gateway"
    assert container["startupProbe"]["httpGet"]["path"] == "/readyz", "a broken one replaces nothing"
    # its secret's files must belong to the relay's user
    assert RUN["metadata"]["annotations"]["run.googleapis.com/execution-environment"] == "gen1"
    # an instance has room for the page beside the streams, and ends a stream before the platform does
    assert found.max_viewers < RUN["spec"]["containerConcurrency"] <= 1000
    assert found.max_connection_age * 1.1 < RUN["spec"]["timeoutSeconds"] <= 3600


def test_the_relay_understands_the_ingest_that_the_page_shows() -> None:
    (block,) = read_blocks("docs/how-to/install/cloud.md", "ini")
    told = dict(line.split("=", 1) for line in block.splitlines())
    assert told.keys() <= VARIABLES
    found = parse(["run"], told)
    assert (found.role, found.zenoh_listen) == ("ingest", ("tls/0.0.0.0:7447",))


@pytest.mark.parametrize("name", PODS)
def test_every_pod_is_bound_hand_and_foot(name: str) -> None:
    pod = PODS[name]
    assert pod["automountServiceAccountToken"] is False
    assert pod["securityContext"]["runAsNonRoot"] is True
    assert pod["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
    for container in pod["containers"]:
        bound = {
            "allowPrivilegeEscalation": False,
            "readOnlyRootFilesystem": True,
            "capabilities": {"drop": ["ALL"]},
        }
        assert container["securityContext"] == bound
        assert container["resources"]["limits"]["memory"]
        assert {"livenessProbe", "readinessProbe"} <= container.keys()
        assert ":latest" not in container["image"]
    secrets = [volume["secret"] for volume in pod["volumes"] if "secret" in volume]
    assert all(secret["defaultMode"] & 0o007 == 0 for secret in secrets), "the relay refuses others"


def test_there_is_time_to_go_and_one_goes_at_a_time() -> None:
    gateway = PODS["gateway"]
    (container,) = gateway["containers"]
    pause_s = int(container["lifecycle"]["preStop"]["exec"]["command"][1])
    for pod, before_s in ((gateway, pause_s), (PODS["ingest"], 0)):
        assert pod["terminationGracePeriodSeconds"] > before_s + END_S
    (budget,) = (doc["spec"] for doc in ALL if doc["kind"] == "PodDisruptionBudget")
    assert budget["maxUnavailable"] == 1
    (scaler,) = (doc["spec"] for doc in ALL if doc["kind"] == "HorizontalPodAutoscaler")
    viewers = next(metric["pods"] for metric in scaler["metrics"] if metric["type"] == "Pods")
    assert viewers["metric"]["name"] == "posecast_viewers"
    room = settings(container, POSECAST_ROBOTS=__file__).max_viewers
    target = int(viewers["target"]["averageValue"])
    assert target < room
    cpu = next(metric["resource"] for metric in scaler["metrics"] if metric["type"] == "Resource")
    assert f"for every {target:,} viewers (each allows {room:,})" in PAGE
    assert f"more than {cpu['target']['averageUtilization']} % of a core" in PAGE


def test_nobody_reaches_redis_or_metrics_from_outside() -> None:
    services = {doc["metadata"]["name"]: doc["spec"] for doc in ALL if doc["kind"] == "Service"}
    assert {name for name, spec in services.items() if spec.get("type", "ClusterIP") != "ClusterIP"} == {
        "robots"
    }
    assert [port["targetPort"] for port in services["robots"]["ports"]] == ["robots"]
    assert [port["targetPort"] for port in services["gateway"]["ports"]] == ["http"]
    policies = {doc["metadata"]["name"]: doc["spec"] for doc in ALL if doc["kind"] == "NetworkPolicy"}
    assert policies["nobody"] == {"podSelector": {}, "policyTypes": ["Ingress"]}
    assert policies["redis"]["policyTypes"] == ["Ingress", "Egress"]
    assert "egress" not in policies["redis"], "it sends nothing out"
    for name in ("redis", "metrics"):
        assert all("from" in rule for rule in policies[name]["ingress"])


def test_kustomize_takes_it() -> None:
    kustomize = next(
        (words for words in (["kustomize", "build"], ["kubectl", "kustomize"]) if shutil.which(words[0])),
        None,
    )
    if kustomize is None:
        pytest.skip("neither kustomize nor kubectl here")
    done = subprocess.run([*kustomize, str(BASE)], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    built = [doc for doc in yaml.safe_load_all(done.stdout) if doc]
    assert len(built) == len(ALL) - 1, "all but kustomization.yaml itself"
    images = set(re.findall(r"image: (\S+)", done.stdout))
    assert images == {"registry.example/posecast:0.1.0", "redis:7"}
