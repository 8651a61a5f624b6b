"""infra/observability: the alarms fire when they should, and dashboard and alarms use existing metrics."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import urllib.parse
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from posecast_relay.core.stream import FrameOutcome
from posecast_testing import free_port, until
from posecast_wire import Close

from tests.conftest import BIN, Stack

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "infra/observability"
METRICS = (ROOT / "docs/reference/metrics.md").read_text()
MONITOR = (ROOT / "docs/how-to/operate/monitor.md").read_text()
DASHBOARD: dict[str, Any] = json.loads((FOLDER / "grafana/posecast.json").read_text())
ALERTS: list[dict[str, Any]] = [
    rule for group in yaml.safe_load((FOLDER / "rules.yml").read_text())["groups"] for rule in group["rules"]
]
PANELS = [panel for panel in DASHBOARD["panels"] if panel["type"] != "row"]
QUERIES = [(panel["title"], target["expr"]) for panel in PANELS for target in panel["targets"]]
WINDOW = "10s"  # instead of what Grafana puts in for $__rate_interval, with a scrape a second
# Of a mirror, of counters that are there once they count: not of the relay that is started here.
ELSEWHERE = {"posecast_mirror_breaker_open"}
UNCOUNTED = {"posecast_faults_total", "posecast_endings_total"}
LABELS = {
    "state": {"online", "silent", "offline"},
    "fate": {*(fate.value for fate in FrameOutcome), "dropped", "written"},
    "code": {str(int(close)) for close in Close},
    "flag": {"--zenoh-tls-cert", "--zenoh-ca"},
    "le": set[str](),
}
OF_PROMETHEUS = {"job", "instance", "service", "alertstate", "alertname"}

needs_prometheus = pytest.mark.skipif(shutil.which("prometheus") is None, reason="no prometheus here")


def promtool(*words: str) -> str:
    done = subprocess.run(
        ["promtool", *words], cwd=FOLDER, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@needs_prometheus
def test_each_alarm_sounds_when_it_should_and_not_before() -> None:
    assert "SUCCESS" in promtool("check", "config", "prometheus.yml")
    assert "SUCCESS" in promtool("test", "rules", "rules_test.yml")
    sound: set[str] = set()
    for scenario in yaml.safe_load((FOLDER / "rules_test.yml").read_text())["tests"]:
        checks = scenario["promql_expr_test"]
        assert {check["expr"] for check in checks} == {'group by (alertname) (ALERTS{alertstate="firing"})'}
        assert checks[0]["exp_samples"] == [], f"{scenario['name']}: when is it silent?"
        sound |= {
            name
            for check in checks
            for sample in check["exp_samples"]
            for name in re.findall(r'alertname="(\w+)"', sample["labels"])
        }
    assert sound == {alert["alert"] for alert in ALERTS}


@pytest.mark.docs
def test_the_reference_has_the_same_alarms() -> None:
    rows = re.findall(
        r"^\| `(\w+)` \| `(.+)`(?: for (\w+))? \| \[[^]]+\]\(\.\./how-to/operate/([a-z-]+\.md#[a-z-]+)\) \|$",
        METRICS,
        re.MULTILINE,
    )
    assert {name: (when, duration or None, head) for name, when, duration, head in rows} == {
        alert["alert"]: (alert["expr"], alert.get("for"), alert["annotations"]["runbook"]) for alert in ALERTS
    }
    assert {alert["labels"]["severity"] for alert in ALERTS} == {"critical", "warning"}
    for file in re.findall(r"^\| `([\w./]+\.(?:yml|json))` \|", MONITOR, re.MULTILINE):
        assert (FOLDER / file).is_file(), file


@pytest.mark.docs
def test_the_panels_stand_side_by_side_under_questions() -> None:
    rows = [panel for panel in DASHBOARD["panels"] if panel["type"] == "row"]
    assert all(row["title"].endswith("?") for row in rows)
    assert len(PANELS) <= 20
    taken: set[tuple[int, int]] = set()
    for panel in DASHBOARD["panels"]:
        at = panel["gridPos"]
        cells = {(at["x"] + x, at["y"] + y) for x in range(at["w"]) for y in range(at["h"])}
        assert not cells & taken, f"{panel['title']} lies over another panel"
        assert at["x"] + at["w"] <= 24, f"{panel['title']} is cut off"
        taken |= cells
    assert len({panel["id"] for panel in DASHBOARD["panels"]}) == len(DASHBOARD["panels"])
    source = yaml.safe_load((FOLDER / "grafana/datasource.yml").read_text())["datasources"][0]
    for panel in PANELS:
        assert panel["datasource"]["uid"] == source["uid"]
        assert {target["datasource"]["uid"] for target in panel["targets"]} == {source["uid"]}


class Prometheus:
    """A real Prometheus that scrapes a real relay."""

    def __init__(self, port: int) -> None:
        self._url = f"http://127.0.0.1:{port}/api/v1"

    def _get(self, path: str, **query: str) -> Any:
        with urllib.request.urlopen(f"{self._url}/{path}?{urllib.parse.urlencode(query)}", timeout=10) as got:
            return json.load(got)["data"]

    def ask(self, expression: str) -> list[dict[str, Any]]:
        """The current samples of an expression."""
        found: list[dict[str, Any]] = self._get("query", query=expression)["result"]
        return found

    def is_up(self) -> bool:
        """Whether it has scraped the relay a few times by now."""
        try:
            found = self.ask(
                'min(count_over_time(posecast_edge_frames_total{fate="taken",job="posecast"}[1m]))'
            )
        except OSError:
            return False
        return bool(found) and float(found[0]["value"][1]) >= 5

    def list_labels(self, metric: str) -> set[str]:
        """The names of the labels that its series have."""
        series: list[dict[str, str]] = self._get("series", **{"match[]": metric})
        return {name for each in series for name in each} - {"__name__"}

    def list_health(self) -> set[str]:
        """How the rules were read and computed: `ok`, `err` or `unknown`."""
        return {rule["health"] for group in self._get("rules")["groups"] for rule in group["rules"]}

    def list_alerts(self) -> dict[str, str]:
        """Which alarms fire, or are about to."""
        return {each["labels"]["alertname"]: each["state"] for each in self._get("alerts")["alerts"]}


@pytest.fixture
def prometheus(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Prometheus]:
    """The shipped configuration with other targets and intervals; for a relay with all its stores."""
    folder = tmp_path_factory.mktemp("observability")
    stack = Stack(folder)
    try:
        metrics, port = free_port(), free_port()
        there = {"SECRET_FOLDER": str(folder), "ROBOTS_FOLDER": str(folder), "SITE": "127.0.0.1"}
        path = {"PATH": f"{BIN}:{os.environ['PATH']}"}
        subprocess.run(["sh", ROOT / "infra/first_start.sh"], env=os.environ | there | path, check=True)
        relay = stack.start(
            "relay",
            *(*stack.relay_command, "run", "--port", "0", "--robots", str(folder / "robots.toml")),
            *("--zenoh-listen", "tls/127.0.0.1:0", "--zenoh-tls-cert", str(folder / "relay.pem")),
            *("--zenoh-tls-key", str(folder / "relay.key"), "--metrics-port", str(metrics)),
            *("--store", stack.redis(), "--past", f"file://{folder}/past"),
        )
        at = relay.line(r"serving http://(\S+), robots on (\S+)")
        stack.start(
            *("edge", *stack.edge_command, "run", "--source", "demo", "--relay", at[2]),
            *("--credential", str(folder / "demo.credential")),
        )
        config = yaml.safe_load((FOLDER / "prometheus.yml").read_text())
        config["global"] = {"scrape_interval": "1s", "evaluation_interval": "1s"}
        (job,) = config["scrape_configs"]
        for of_the_cloud in ("dns_sd_configs", "relabel_configs"):
            del job[of_the_cloud]
        labels = {"service": "relay"}
        job["static_configs"] = [{"targets": [f"127.0.0.1:{metrics}"], "labels": labels}]
        (folder / "prometheus.yml").write_text(json.dumps(config))
        shutil.copy(FOLDER / "rules.yml", folder)
        stack.start(
            *("prometheus", "prometheus", f"--config.file={folder}/prometheus.yml"),
            *(f"--storage.tsdb.path={folder}/data", f"--web.listen-address=127.0.0.1:{port}"),
        )
        made = Prometheus(port)
        watch = f"ws://{at[1]}/api/v1/robots/demo/live?hz=10"
        viewer = (sys.executable, "-m", "posecast_loadtests.control", watch, "3")
        stack.start("viewer", *viewer, stdin=subprocess.PIPE)  # until that ends
        until("it has asked a few times", made.is_up, 60)
        yield made
    finally:
        for part in reversed(stack.parts):
            part.stop()
            print(part.log[-3000:])


def name_metrics(expression: str) -> set[str]:
    """The metrics that it uses."""
    return set(re.findall(r"posecast_\w+", expression))


def check_panels(prometheus: Prometheus) -> None:
    """Each shows what a running relay tells."""
    for title, query in QUERIES:
        found = prometheus.ask(query.replace("$__rate_interval", WINDOW))
        can_be_empty = bool(name_metrics(query) & UNCOUNTED) or "ALERTS" in query
        assert found or can_be_empty, f"{title}: nothing"
        legend = next(t["legendFormat"] for p in PANELS for t in p["targets"] if t["expr"] == query)
        for label in re.findall(r"\{\{(\w+)\}\}", legend):
            assert all(label in sample["metric"] for sample in found), f"{title}: no {label} for the legend"


def check_names(prometheus: Prometheus) -> None:
    """Dashboard and alarms name metrics and labels that there are."""
    expressions = [query for _, query in QUERIES] + [alert["expr"] for alert in ALERTS]
    for metric in sorted(set().union(*map(name_metrics, expressions)) - ELSEWHERE - UNCOUNTED):
        assert prometheus.ask(metric), f"no running relay tells {metric}"
    for expression in expressions:
        for metric, matchers in re.findall(r"(posecast_\w+)\{([^}]*)\}", expression):
            for label, value in re.findall(r'(\w+)="([^"]*)"', matchers):
                assert value in LABELS[label], expression
                if metric not in ELSEWHERE | UNCOUNTED:
                    assert label in prometheus.list_labels(metric), expression
        for grouped in re.findall(r"\b(?:by|on) ?\(([\w, ]+)\)", expression):
            assert set(grouped.split(", ")) <= LABELS.keys() | OF_PROMETHEUS, expression


@needs_prometheus
def test_a_running_relay_fills_each_panel_and_sounds_no_alarm(prometheus: Prometheus) -> None:
    check_panels(prometheus)
    check_names(prometheus)
    until("all rules have been looked at", lambda: prometheus.list_health() == {"ok"})
    sound = {alert for alert, state in prometheus.list_alerts().items() if state == "firing"}
    assert sound <= {"DiskNearlyFull"}  # which the disk of this machine may be
