"""stub"""
from __future__ import annotations

from posecast_edge.model.files import Files
from posecast_edge.model.finding import Finding
from posecast_edge.model.tree import Tree
from posecast_edge.model.urdf import Urdf


class MeshFacts:
    @staticmethod
    def of(files: Files) -> dict[str, MeshFacts]:
        return {}
def examine(urdf: Urdf, tree: Tree, facts: dict[str, MeshFacts]) -> list[Finding]:
    return []
