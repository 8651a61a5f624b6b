"""The commands of docs/how-to/robots, typed in order: each has a robot of its kind to read, and the relay
shows that robot. tests/test_install.py runs the lines of pip.
"""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from posecast_edge.profile.reader import find_profile, load_profile, parse_profile
from posecast_testing import until

from relay.tests.certificates import certificates
from tests.conftest import BIN, Stack
from tests.doc_blocks.block import ROOT, read_pages
from tests.doc_blocks.terminal import Terminal, fetch, find_line, read_script, read_scripts

EDGE_TESTS = ROOT / "edge-agent" / "tests"
ARM = (ROOT / "edge-agent/examples/arm.urdf").read_text(encoding="utf-8")
ROBOTS = "docs/how-to/robots"
JOINTS = ["shoulder", "elbow"]
RECORDED_S = 60
HZ = 20
SIMULATION = """<mujoco model="swing"><worldbody><body name="arm"><joint name="elbow" axis="0 1 0"/>
<geom name="rod" type="capsule" size="0.02" fromto="0 0 0 0 0 0.3"/></body></worldbody>
<actuator><position name="servo" joint="elbow" kp="20" ctrlrange="-1 1"/></actuator></mujoco>"""


@pytest.fixture(scope="module", autouse=True)
def edge_tests() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(EDGE_TESTS))
        yield


@pytest.fixture(scope="module")
def on_air(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Stack, str, str]]:
    """One relay for all robots: (what is started, its HTTP address, where robots connect)."""
    stack = Stack(tmp_path_factory.mktemp("relay"))
    _, http, zenoh = stack.relay()
    yield stack, http, zenoh
    for part in reversed(stack.parts):
        part.stop()


class Desk:
    """Types a page's commands beside a robot, and looks at what the relay has of it."""

    def __init__(self, stack: Stack, http: str, zenoh: str, folder: Path) -> None:
        self.terminal = Terminal(stack, folder, {"tcp/127.0.0.1:7447": zenoh})
        self.http, self._zenoh, self._count = http, zenoh, 0
        self.folder = folder
        for name in ("arm.urdf", "robot.urdf", "model.urdf"):
            (folder / name).write_text(ARM, encoding="utf-8")

    def replace(self, shown: str, mine: str) -> None:
        """`mine` is typed where the page has `shown`."""
        self.terminal.instead = {**self.terminal.instead, shown: mine}

    def type_page(self, page: str, *, words: str = "") -> None:
        """All shell blocks of a page that have these words."""
        for script in read_scripts(page, words):
            for line in script.splitlines():
                self.type_line(line)

    def type_line(self, line: str) -> None:
        """One command, which then did what the pages promise."""
        command = re.split(r"\| ", line)[-1].split()
        match command[1:2]:
            case _ if command[0] == "pip":
                return
            case ["run"]:
                self.show(line)
            case ["relay"]:
                part = self.terminal.start(line, "--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0")
                find_line(part, r"serving http://\S+, robots on tcp/")
                part.stop()
            case ["probe"]:
                assert re.search(r"\bpos\b", self.terminal.run(line))
            case ["doctor"]:
                allowed = (1,) if "--profile" in line else ()  # the profile is not edited, which it says
                said = self.terminal.run(line.replace("--seconds 30", "--seconds 3"), *allowed)
                assert "robot.urdf: robot 'arm', 3 links, 2 joints: nothing wrong" in said
            case ["profile"]:
                self.terminal.run(line)
                assert parse_profile((self.folder / "robot.toml").read_text()).labels["joint"] == tuple(
                    JOINTS
                )
            case ["model"]:
                self.terminal.run(line)
                assert (self.folder / "bundle/manifest.json").exists()
            case _:
                raise AssertionError(f"no way to look at: {line}")

    def show(self, line: str) -> None:
        """A robot is on air, and has a body if a model is named."""
        self._count += 1
        found = re.search(r"--robot (\S+)", line)
        robot = found[1] if found else f"{self.folder.name.replace('_', '-')}-{self._count}"
        more = ["--robot", robot] if found is None else []
        more += ["--relay", self._zenoh] if "--relay" not in line else []
        part = self.terminal.start(line, *more)
        url = f"http://{self.http}/api/v1/robots/{robot}"

        def is_seen() -> bool:
            assert part.process.poll() is None, part.log
            found = fetch(f"{url}/state")
            return found is not None and found["status"] == "online" and "pos" in found["fields"]

        until(f"seen: {line}", is_seen, 60)
        if re.search(r"--(urdf|model)\b", line):
            until(f"a body: {line}", lambda: fetch(url)["model"], 60)
        part.stop()


@pytest.fixture
def desk(on_air: tuple[Stack, str, str], tmp_path: Path) -> Desk:
    return Desk(*on_air, tmp_path)


@pytest.fixture
def ros2(desk: Desk) -> Iterator[Desk]:
    """Beside an arm with ROS 2 and a Zenoh router, which describes itself."""
    import ros_stage
    from posecast_edge.sources.ros.messages import JOINT_STATE, STRING
    from source_stage import Mover

    robot = ros_stage.Graph().start()
    robot.latch("/robot_description", STRING, ros_stage.text_message(ARM))

    def put(_: float) -> None:
        state = ros_stage.joint_state(time.monotonic(), JOINTS, [time.monotonic() % 1, 0.2])
        robot.publish("/joint_states", JOINT_STATE, state)

    mover = Mover(50, put)
    for shown in ("ros2:192.168.0.5", "ros2:ROBOT"):
        desk.replace(shown, robot.source)
    yield desk
    mover.end()
    robot.stop()


def test_add_a_robot(ros2: Desk) -> None:
    page = f"{ROBOTS}/add-a-robot.md"
    *local, elsewhere = read_scripts(page)
    assert "--credential" in elsewhere
    for script in local:
        for line in script.splitlines():
            ros2.type_line(line)

    certificates(ros2.folder, host="DNS:localhost")
    add = "posecast robots add my-robot --robots robots.toml --ca ca.pem > my-robot.credential"
    ros2.terminal.run(f"umask 077; {add}")
    relay = ros2.terminal.stack.start(
        "tls",
        *(f"{BIN}/posecast-relay", "run", "--port", "0", "--robots", f"{ros2.folder}/robots.toml"),
        *("--zenoh-listen", "tls/127.0.0.1:0", "--zenoh-tls-cert", f"{ros2.folder}/server.pem"),
        *("--zenoh-tls-key", f"{ros2.folder}/server.key"),
    )
    _, port = find_line(relay, r"serving http://(\S+), robots on tls/127\.0\.0\.1:(\d+)").groups()
    ros2.replace("tls/RELAY:7447", f"tls/localhost:{port}")
    robot = ros2.terminal.start(elsewhere)
    until("it is on air with its credential", lambda: "on air" in robot.log, 60)
    robot.stop()
    relay.stop()


def test_ros2(ros2: Desk) -> None:
    ros2.type_page(f"{ROBOTS}/ros2.md")


def test_urdf(ros2: Desk) -> None:
    (ros2.folder / "catkin_ws/src").mkdir(parents=True)
    ros2.type_page(f"{ROBOTS}/urdf.md")


def test_rosbridge(desk: Desk) -> None:
    from posecast_edge.sources.ros.messages import JOINT_STATE
    from rosbridge_stage import Rosbridge, joint_state
    from source_stage import Mover

    robot = Rosbridge({"/joint_states": JOINT_STATE})

    def put(_: float) -> None:
        robot.publish("/joint_states", joint_state(time.monotonic(), JOINTS, [0.1, 0.2]))

    mover = Mover(50, put)
    try:
        desk.replace("rosbridge:ROBOT", robot.source)
        desk.type_page(f"{ROBOTS}/rosbridge.md")
    finally:
        mover.end()
        robot.stop()


def test_mujoco(desk: Desk) -> None:
    pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
    (desk.folder / "robot.xml").write_text(SIMULATION, encoding="utf-8")
    desk.type_page(f"{ROBOTS}/mujoco.md")


def test_show_balance(desk: Desk) -> None:
    desk.type_page(f"{ROBOTS}/show-balance.md")


def test_a_relay_for_python_programs(desk: Desk) -> None:
    desk.type_page(f"{ROBOTS}/python.md")


def test_a_program_that_prints_lines(desk: Desk) -> None:
    programs = [block.text for block in read_pages()["README.md"] if "# wave.py" in block.text]
    (desk.folder / "wave.py").write_text(programs[0], encoding="utf-8")
    pages = (f"{ROBOTS}/jsonl.md", "docs/index.md", "docs/how-to/install/install.md")
    lines = {read_script(page, "wave.py |") for page in pages}
    for line in {line.replace(".venv/bin/", "").replace("edge-agent/examples/", "") for line in lines}:
        desk.type_line(line)


def test_recordings(desk: Desk) -> None:
    pytest.importorskip("mcap", reason="the extra [mcap] is not installed")
    from bag_stage import BEGAN_NS, Bag, joint_state, walk, write_ros2
    from rosbags.rosbag2 import StoragePlugin

    rows = "".join(f"{k / HZ},{k % HZ / HZ},0.2\n" for k in range(RECORDED_S * HZ))
    (desk.folder / "walk.csv").write_text(f"t,shoulder,elbow\n{rows}", encoding="utf-8")
    bag = Bag()
    for k in range(RECORDED_S * HZ):
        t_ns = BEGAN_NS + k * 10**9 // HZ
        bag.add(
            "/joint_states", "sensor_msgs/msg/JointState", t_ns, joint_state(t_ns, shoulder=0.1, elbow=0.2)
        )
    (desk.folder / "walk_0.mcap").write_bytes(bag.finish())
    write_ros2(
        desk.folder / "rosbag2_2026_11_23", walk(ros1=False, count=RECORDED_S * 100), StoragePlugin.SQLITE3
    )
    desk.type_page(f"{ROBOTS}/recordings.md")


def write_walk(path: Path) -> None:
    """A file for `hubo2plus`: every joint at rest."""
    trajectory = load_profile(find_profile("hubo2plus")).trajectory
    assert trajectory is not None
    path.write_text((" ".join(["0.0"] * len(trajectory.columns)) + "\n") * 400, encoding="utf-8")


def test_trajectory(desk: Desk) -> None:
    write_walk(desk.folder / "walk.traj")
    desk.type_page(f"{ROBOTS}/trajectory.md")


def test_hubo_ach(desk: Desk) -> None:
    write_walk(desk.folder / "walk.traj")
    words = (sys.executable, str(EDGE_TESTS / "hubo_stage.py"), "hubo2plus", str(desk.folder / "walk.traj"))
    robot = desk.terminal.stack.start("hubo", "env", f"PYTHONPATH={EDGE_TESTS}", *words)
    desk.replace("hubo-ach:192.168.0.5", find_line(robot, r"(hubo-ach:\S+)")[1])
    desk.type_page(f"{ROBOTS}/hubo-ach.md", words="192.168.0.5")
    robot.stop()


@pytest.mark.skipif(sys.platform != "linux", reason="shared memory as ach lays it out on Linux")
def test_hubo_ach_in_shared_memory(desk: Desk) -> None:
    from ach_stage import Writer
    from hubo_stage import Walker

    write_walk(desk.folder / "walk.traj")
    channel = Writer(desk.folder / "channel", frame_size=4096)
    walker = Walker(load_profile(find_profile("hubo2plus")), desk.folder / "walk.traj", channel.put)
    try:
        desk.replace("hubo-ach:shm", f"hubo-ach:shm:{desk.folder}/channel")
        desk.type_page(f"{ROBOTS}/hubo-ach.md", words="hubo-ach:shm")
    finally:
        walker.end()
