"""Who writes which fields: only an object's own module, and a viewer's only `core/viewer.py`."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import posecast_relay
import pytest
from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import Audience, Grant, Principal
from posecast_relay.core.viewer import FlowControl, Viewer
from posecast_wire import Close

from .sim import Screen, World

ROOT = Path(posecast_relay.__file__).parent
VIEWER = "core/viewer.py"
COUNTED = {"sent"}  # by the walk over a crowd as well, one line per viewer and frame

# Of Python and of libraries, which have no other way.
OTHERS_OBJECTS = {
    ("logging.py", "sys.excepthook"),
    ("logging.py", "sys.unraisablehook"),
    ("logging.py", "threading.excepthook"),
    ("logging.py", "self._timer.daemon"),  # a threading.Timer takes it nowhere else
    ("server/http_server.py", "last.daemon"),
    ("recording/output.py", "entry.create_system"),  # zipfile.ZipInfo
    ("recording/output.py", "entry.external_attr"),
    ("zenoh/router.py", "sys.stdout"),
    ("runtime/fan_out.py", "self._syscall.restype"),  # ctypes
    ("net/http1.py", "cycle.disconnected"),  # uvicorn's own protocol does so
    ("net/http1.py", "self.answering.disconnected"),
    ("net/http1.py", "self.cycle.keep_alive"),
    ("net/http1.py", "cycle.keep_alive"),
    ("net/http1.py", "cycle.default_headers"),
    ("net/websocket.py", "self._ws.parser_exc"),  # else it holds itself in a circle
}


@pytest.fixture(scope="module")
def trees() -> dict[str, ast.Module]:
    """Of all modules."""
    return {str(path.relative_to(ROOT)): ast.parse(path.read_text()) for path in sorted(ROOT.rglob("*.py"))}


def assigned(tree: ast.AST) -> Iterator[ast.Attribute]:
    """Every attribute that is assigned or deleted, by whichever statement: `x.a = …` and `x.y.a += …`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store | ast.Del):
            yield node


def is_self(node: ast.Attribute) -> bool:
    """Whether it is a method that writes its own object's field."""
    return isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")


def declared(tree: ast.Module) -> set[str]:
    """The fields of a module's own classes: of those it may write any."""
    found = {node.attr for node in assigned(tree) if is_self(node)}
    for cls in ast.walk(tree):
        for node in cls.body if isinstance(cls, ast.ClassDef) else ():
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                found.add(node.target.id)
    return found


def test_only_its_own_module_writes_an_objects_fields(trees: dict[str, ast.Module]) -> None:
    """So nothing hangs a hook into somebody else's object, either: ports go in through constructors."""
    found = set()
    for name, tree in trees.items():
        own = declared(tree)
        others = (node for node in assigned(tree) if not is_self(node) and node.attr not in own)
        found |= {(name, ast.unparse(node)) for node in others}
    assert found == OTHERS_OBJECTS


def test_no_field_is_written_by_its_name_as_a_text(trees: dict[str, ast.Module]) -> None:
    for name, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call):
                called = ast.unparse(node.func)
                assert called not in ("setattr", "delattr", "object.__setattr__"), f"{name}:{node.lineno}"


def test_only_flow_control_writes_its_fields(trees: dict[str, ast.Module]) -> None:
    classes = {node.name: node for node in trees[VIEWER].body if isinstance(node, ast.ClassDef)}
    flow = set(FlowControl.__slots__)
    assert {node.attr for node in assigned(classes["FlowControl"])} == flow
    assert {node.attr for node in assigned(classes["Viewer"])} & flow == COUNTED
    assert {node.attr for node in assigned(classes["Viewer"])} - COUNTED == set(Viewer.__slots__)
    assert {node.attr for node in assigned(trees[VIEWER])} == flow | set(Viewer.__slots__)


def test_nobody_else_writes_a_field_of_what_is_called_a_viewer(trees: dict[str, ast.Module]) -> None:
    for name, tree in trees.items():
        for node in assigned(tree):
            whose = ast.unparse(node.value)
            assert name == VIEWER or not whose.endswith("viewer"), (
                f"{name}:{node.lineno}: {whose}.{node.attr}"
            )


def test_whatever_it_is_called_nobody_else_writes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    writers: set[str] = set()

    def noted(self: Viewer, name: str, value: Any) -> None:
        writers.add(sys._getframe(1).f_globals["__name__"])
        object.__setattr__(self, name, value)

    monkeypatch.setattr(Viewer, "__setattr__", noted)
    world = World(Limits(max_age_s=100.0, reliable_queue=2))
    edge = world.on_air(key_every_s=0.5)
    grants = [Grant("r", "public", hz, 0.0, None, Audience.ANYONE, Principal()) for hz in (60.0, 5.0)]
    viewers = []
    for hz in (30.0, 30.0, 7.0, 0.0):
        viewer = Viewer(Screen(), "r", "public", hz, world.limits, world.now, grant=grants[0])
        world.do(world.hub.join(viewer, world.now, 0.0))
        viewers.append(viewer)
    world.run(edge, 2.0)
    for viewer in viewers:
        world.say(viewer, type="ack", n=viewer.sent)
        world.say(viewer, type="rate", hz=12)
    world.do(world.hub.replace_grant(viewers[0], grants[1], world.now))
    viewers[1].pause(world.now)
    edge.info = {"a": "b"}
    world.answer(edge)
    world.do(world.hub.measure_load(0.5, world.now))
    world.do(world.hub.resume_viewer(viewers[1]))
    world.now += 5.0  # the process stood still
    world.run(edge, 20.0)
    assert world.hub.endings[Close.NO_ACK] + world.hub.endings[Close.HALF_OPEN] == 4
    assert writers == {Viewer.__module__}
