"""Damaged files: read, or refused in one line; nothing else."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from model_stage import (
    ROBOT_OF_ALL,
    cube_collada,
    cube_glb,
    cube_obj,
    cube_stl,
    cube_text_stl,
    joint,
    link,
    robot,
)
from posecast_edge.model.doctor.skeleton import examine_model
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes.collada import read_collada
from posecast_edge.model.meshes.gltf import read_gltf
from posecast_edge.model.meshes.mesh import Mesh, validate_mesh
from posecast_edge.model.meshes.obj import read_obj
from posecast_edge.model.meshes.stl import read_stl
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.tree import build_tree
from posecast_edge.model.urdf.types import Urdf

EFFECT = (
    "<transparent><color>1 1 1 1</color></transparent><transparency><float>0.5</float></transparency>"
    '<diffuse><texture texture="t"/></diffuse>'
)


def load(_name: str) -> bytes:
    raise ModelRefused("no such file")


READERS: dict[str, tuple[bytes, Callable[[bytes], Mesh]]] = {
    "stl": (cube_stl(), read_stl),
    "text stl": (cube_text_stl(), read_stl),
    "obj": (cube_obj("mtllib a.mtl\nusemtl m\n"), lambda data: read_obj(data, load)),
    "collada": (
        cube_collada(effect=EFFECT, node="<rotate>0 0 1 90</rotate>"),
        lambda data: read_collada(data, load),
    ),
    "glb": (cube_glb(), lambda data: read_gltf(data, load)),
}

damages = st.lists(
    st.tuples(st.integers(0, 1 << 16), st.integers(0, 6), st.binary(max_size=6)), min_size=1, max_size=4
)


def damaged(data: bytes, changes: list[tuple[int, int, bytes]]) -> bytes:
    """Bytes replaced, left out or put in, at some places."""
    for place, length, new in changes:
        at = place % (len(data) + 1)
        data = data[:at] + new + data[at + length :]
    return data


@pytest.mark.parametrize("kind", READERS)
@settings(max_examples=150, deadline=None)
@given(changes=damages)
def test_meshes(kind: str, changes: list[tuple[int, int, bytes]]) -> None:
    data, read = READERS[kind]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # numbers beyond float32
        try:
            mesh = validate_mesh(read(damaged(data, changes)))
        except ModelRefused as refused:
            said = refused.reason
        else:
            assert mesh.triangles > 0
            said = ""
    assert said.isprintable()
    assert len(said) < 300


@settings(max_examples=300, deadline=None)
@given(changes=damages)
def test_urdfs(changes: list[tuple[int, int, bytes]]) -> None:
    try:
        urdf = read_urdf(io.BytesIO(damaged(ROBOT_OF_ALL, changes)))
    except ModelRefused as refused:
        said = refused.reason
        urdf = Urdf("")
    else:
        said = ""
    assert said.isprintable()
    tree = build_tree(urdf)
    assert all(f.format_line("x").isprintable() for f in examine_model(urdf, tree, {}))
    assert [tree.index[j.child] for j in tree.joints] == list(range(1, len(tree.links)))
    assert all(tree.index[j.parent] < tree.index[j.child] for j in tree.joints)


names = st.sampled_from(["a", "b", "c", "d", "e"])


@settings(max_examples=200, deadline=None)
@given(
    links=st.lists(names, max_size=6),
    joints=st.lists(st.tuples(names, names, names, names), max_size=8),
)
def test_trees_of_any_shape(links: list[str], joints: list[tuple[str, str, str, str]]) -> None:
    """Every link is shown, or a finding says that it is not."""
    parts = [link(name) for name in links]
    parts += [
        joint(name, parent, child, inside=f'<axis xyz="0 0 1"/><mimic joint="{mimic}"/>')
        for name, parent, child, mimic in joints
    ]
    tree = build_tree(read_urdf(io.BytesIO(robot(*parts).encode())))
    lost = set(links) - set(tree.index)
    assert bool(lost) <= bool(tree.findings)
    assert len(tree.links) == len(tree.joints) + 1 or not tree.links
    assert all(f is None or tree.joints[f.joint].mimic is None for f in tree.follows)
