"""Which test runs which block, and which blocks no test runs, with the reason.

In both tables a line stands for the blocks of a page whose source has the words, fence included: "```python"
is every block of Python on the page, "" every block. A block that data alone makes up (DATA) needs no line:
it is read here.
"""

from __future__ import annotations

# Languages whose blocks are parsed by languages.py when no line below names them.
DATA = ("html", "ini", "json", "yaml")
# Diagrams, addresses and outputs. languages.py refuses a command in one of them.
TEXT = ("text",)

ROBOTS, OPERATE = "tests/doc_blocks/test_robot_commands.py", "tests/doc_blocks/test_relay_commands.py"
START, SCALE = "tests/doc_blocks/test_start_commands.py", "tests/doc_blocks/test_scale_commands.py"
MACHINE, INSTALL = "tests/doc_blocks/test_machine_commands.py", "tests/test_install.py"
RECORD, EXPORT = "tests/test_recordings_doc.py", "relay/tests/test_export_docs.py"
PROFILES, FILES = "tests/test_robots_page.py", "relay/tests/test_operator_pages.py"
CONTAINERS = "tests/compose/recipes.py"

# page → words of its blocks → the test
RUN: dict[str, dict[str, str]] = {
    "CONTRIBUTING.md": {"make demo": START, "-m fuzz": START},
    "README.md": {
        "make demo": START,
        "```python": "tests/test_readme.py",
        "wave.py |": "tests/test_readme.py",
    },
    "docs/index.md": {"make demo": START, "wave.py |": ROBOTS, "make dist": INSTALL},
    "docs/how-to/install/cloud.md": {
        "kubectl apply -k": "tests/test_cloud.py",
        "POSECAST_ROLE": "tests/test_cloud.py",
    },
    "docs/how-to/install/containers.md": {
        "compose() {": CONTAINERS,
        "past.tar.gz": CONTAINERS,
        "services:\n": "tests/test_compose_file.py",
    },
    "docs/how-to/install/install.md": {
        "make dist": INSTALL,
        "posecast demo": INSTALL,
        "wave.py |": ROBOTS,
        "dist/posecast_": INSTALL,
        "openssl req": INSTALL,
        "posecast-relay run": INSTALL,
        "posecast-edge run": INSTALL,
        "completion bash": START,
    },
    "docs/how-to/install/offline-and-arm64.md": {"```sh": INSTALL},
    "docs/how-to/install/service.md": {
        "install -D": MACHINE,
        "systemctl enable": MACHINE,
        "```ini\nPOSECAST_": INSTALL,
        "RequiresMountsFor": MACHINE,
        "runuser": MACHINE,
    },
    "docs/how-to/operate/add-robots.md": {"```sh": OPERATE},
    "docs/how-to/operate/admin-page.md": {"posecast-relay": FILES},
    "docs/how-to/operate/back-up.md": {"```sh": "tests/test_backup.py"},
    "docs/how-to/operate/container-recipes.md": {"```sh": CONTAINERS},
    "docs/how-to/operate/decide-who-watches.md": {"export": OPERATE, "posecast-relay robots": FILES},
    "docs/how-to/operate/delete-the-past.md": {
        "past delete": "relay/tests/test_operator_pages.py",
        "past list": OPERATE,
        "robots set": FILES,
        "redis-cli": SCALE,
    },
    "docs/how-to/operate/keep-months.md": {
        "alias": MACHINE,
        "relay robots": MACHINE,
        "relay past list": MACHINE,
        "```toml": MACHINE,
    },
    "docs/how-to/operate/monitor.md": {"curl": OPERATE, "promtool": OPERATE},
    "docs/how-to/operate/troubleshoot-storage.md": {"redis-cli": SCALE},
    "docs/how-to/operate/troubleshoot.md": {"robots check": OPERATE},
    "docs/how-to/operate/use-certificates.md": {
        "openssl": OPERATE,
        "posecast-": OPERATE,
    },
    "docs/how-to/record/csv.md": {"past export": RECORD, "```python": EXPORT},
    "docs/how-to/watch/play-a-recording.md": {"http.server": RECORD},
    "docs/how-to/record/host-a-recording.md": {"http.server": RECORD, "```nginx": RECORD},
    "docs/how-to/record/keep-a-lecture.md": {"```sh": RECORD, "```toml": RECORD},
    "docs/how-to/record/mcap.md": {"past export": RECORD, "```python": EXPORT},
    "docs/how-to/robots/add-a-robot.md": {"```sh": ROBOTS},
    "docs/how-to/robots/hubo-ach.md": {"```sh": ROBOTS},
    "docs/how-to/robots/jsonl.md": {"```json": PROFILES, "```python": PROFILES, "```sh": ROBOTS},
    "docs/how-to/robots/mujoco.md": {"```sh": ROBOTS},
    "docs/how-to/robots/python.md": {"```sh": ROBOTS, "```python": PROFILES},
    "docs/how-to/robots/recordings.md": {"```sh": ROBOTS, "```toml": PROFILES},
    "docs/how-to/robots/ros2.md": {"```sh": ROBOTS, "```toml": PROFILES},
    "docs/how-to/robots/rosbridge.md": {"```sh": ROBOTS},
    "docs/how-to/robots/show-balance.md": {"```sh": ROBOTS, "```toml": "tests/test_balance_page.py"},
    "docs/how-to/robots/trajectory.md": {"```sh": ROBOTS, "```toml": PROFILES},
    "docs/how-to/robots/urdf.md": {"```sh": ROBOTS, "```python": PROFILES},
    "docs/how-to/scale/cache-for-a-crowd.md": {
        "nginx -t": MACHINE,
        "x-cache": "tests/test_hosting.py",
        "posecast.log": MACHINE,
        "```nginx": "tests/test_lane_cache.py",
    },
    "docs/how-to/scale/gateways.md": {"```sh": SCALE, "reverse_proxy": SCALE},
    "docs/how-to/scale/host-the-page.md": {"policy.mjs": SCALE, "```nginx": "tests/test_hosting.py"},
    "docs/how-to/scale/load-tests.md": {
        "activate": START,
        "locust -f": "loadtests/tests/test_three_ways.py",
    },
    "docs/how-to/scale/redis.md": {"requirepass": "relay/tests/test_redis_store.py", "```sh": SCALE},
    "docs/reference/capacity.md": {"tools.scaling": "tests/test_scaling.py"},
    "docs/reference/past-export.md": {"```sh": RECORD},
    "docs/how-to/record/save-from-the-page.md": {"```sh": RECORD},
    "docs/reference/profile.md": {"```toml": PROFILES},
    "docs/reference/protocol.md": {
        "curl": "tests/test_protocol.py",
        "```python": "tests/test_protocol.py",
        "```js\n": "tests/test_protocol.py",
    },
    "docs/reference/robots-file.md": {"```toml": FILES, "```sh": FILES},
    "docs/tutorials/find-the-fault.md": {"make demo": START},
    "docs/tutorials/first-robot.md": {"": "tests/test_tutorial.py"},
}

# reason → page → words of its blocks. Their commands are checked all the same (programs.py).
NOT_RUN: dict[str, dict[str, list[str]]] = {
    "it measures for minutes or hours": {
        "benches/peers/README.md": [""],
        "docs/how-to/scale/load-tests.md": ["make load", "make soak"],
        "docs/reference/attack-tests.md": [""],
        "docs/reference/benchmarks.md": [""],
        "docs/reference/capacity.md": ["tools.segment_bytes"],
    },
    "it is a part of the tests, or writes what is committed": {
        "CONTRIBUTING.md": ["pytest", "e2e -w spa -- table", "make pictures", "make gallery"],
        "docs/explanation/faults.md": ["make faults"],
    },
    "it needs an account or a registry of others": {
        "docs/how-to/install/cloud.md": ["docker ", "kubectl create", "gcloud"],
        "docs/how-to/operate/keep-months.md": ["s3://"],
        "docs/how-to/operate/mirror-to-firebase.md": [""],
        "docs/how-to/scale/host-the-page.md": ["firebase-tools"],
    },
    "it needs a Docker engine with images of others": {
        "docs/how-to/install/containers.md": [
            "--profile demo up",
            "compose up --build --detach",
            "compose pull",
            "robots add",
            "--profile gateways rm",
            "compose cp",
            "robots set",
            "past export",
            "sudo install -d -m 700",
            "docker pull",
        ],
        "docs/how-to/operate/monitor.md": ["up --detach"],
    },
    "it needs another machine, or a service manager": {
        "docs/how-to/operate/admin-page.md": ["ssh"],
        "docs/how-to/operate/monitor.md": ["ssh", "journalctl"],
        "docs/how-to/operate/upgrade.md": [""],
    },
    "zenohd comes as no package of Python; tests/test_mesh.py runs the same router": {
        "docs/how-to/scale/more-robots.md": [""],
    },
}
