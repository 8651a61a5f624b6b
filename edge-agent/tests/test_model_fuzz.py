"""Trees of links that no robot has. Damaged files of each kind: test_parsers.py."""

from __future__ import annotations

import io

from hypothesis import given, settings
from hypothesis import strategies as st
from model_stage import joint, link, robot
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.tree import build_tree
from posecast_testing import count_examples

names = st.sampled_from(["a", "b", "c", "d", "e"])


@settings(max_examples=count_examples(200), deadline=None)
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
    assert [tree.index[j.child] for j in tree.joints] == list(range(1, len(tree.links)))
    assert all(tree.index[j.parent] < tree.index[j.child] for j in tree.joints)
    assert all(f is None or tree.joints[f.joint].mimic is None for f in tree.follows)
