"""What only the page reads. libFuzzer is led by its ways there, see page/build.mjs."""

from __future__ import annotations

from collections.abc import Callable

from fuzz.page_reader import ask
from fuzz.target import Refused, Target
from fuzz.targets.models import as_glb


def of(name: str, made: Callable[[bytes], bytes] = bytes) -> Callable[[bytes], None]:
    """The page's reader of that name; `made`: its file out of a case."""

    def call(data: bytes) -> None:
        ask(name, made(data))

    return call


def target(name: str, stretched: int, corpus: str = "", made: Callable[[bytes], bytes] = bytes) -> Target:
    """A target of Node's."""
    return Target(f"page-{name}", of(name, made), (Refused,), stretched=stretched, page=True, corpus=corpus)


TARGETS = (
    target("message", 1 << 17),
    target("manifest", 1 << 17, corpus="manifest"),
    target("balance", 1 << 17, corpus="manifest"),
    target("glb", 1 << 16, made=as_glb),
    target("body", 1 << 17, corpus="urdf"),
    target("zip", 1 << 16),
    target("posecast-file", 1 << 16, corpus="page-zip"),
    target("stl", 1 << 17, corpus="stl"),
    target("address", 1 << 14),
    target("embed", 1 << 15),
    target("events", 1 << 17),
    target("mirror", 1 << 16),
    target("past", 1 << 17),
    target("lane", 1 << 17),
)
