"""Finds the missing files of a model. Opens none, so it needs no mesh tools."""

from __future__ import annotations

from collections.abc import Collection

from posecast_edge.model.doctor.meshes import MeshFacts
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.urdf.resolver import Resolver
from posecast_edge.model.urdf.types import Urdf, find_material

FILES_MAX = 1000


def find_lost_files(urdf: Urdf, resolver: Resolver, inline: Collection[str] = ()) -> dict[str, MeshFacts]:
    """The meshes and pictures of visuals that can't be found, by URI, with the reason. `inline`: URIs of
    meshes that need no file. Looks for at most FILES_MAX files."""
    uris: dict[str, None] = {}
    for link in urdf.links:
        for shape in link.visuals:
            material = find_material(shape, urdf.materials)
            if shape.geometry is not None and shape.geometry.uri:
                uris[shape.geometry.uri] = None
            if material is not None and material.texture:
                uris[material.texture] = None
    lost: dict[str, MeshFacts] = {}
    for uri in list(uris)[:FILES_MAX]:
        if uri in inline:
            continue
        try:
            resolver.find_file(uri)
        except ModelRefused as e:
            lost[uri] = MeshFacts(uri, e.reason)
    return lost
