"""Parsers of meshes that stand in a scene, whose parts may be named again and again, with the worst input
that is known."""

from __future__ import annotations

import base64

import numpy as np
from mesh_parsers import mesh_work, png
from model_stage import cube_collada, cube_glb, glb_document, pack_glb
from parser_stage import Parser, Worst
from posecast_edge.model.finding import ModelRefused

SHOWN_AGAIN = {"posecast_edge.model.meshes.mesh.SHOWN_AGAIN_MAX": 2000}


def collada(geometry: str, scene: str = '<instance_geometry url="#g"/>', library: str = "") -> bytes:
    """A document around the inside of a <mesh>, a scene's node, and what else there is."""
    return (
        '<COLLADA><library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa">'
        "0 0 0 1 0 0 0 1 0</float_array><technique_common><accessor source='#pa' stride='3'/>"
        '</technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>'
        f"{geometry}</mesh></geometry></library_geometries>{library}<library_visual_scenes>"
        f"<visual_scene><node>{scene}</node></visual_scene></library_visual_scenes></COLLADA>"
    ).encode()


def triangles(corners: str = "0 1 2", source: str = "#v", semantic: str = "VERTEX") -> str:
    entry = f'<input semantic="{semantic}" source="{source}"/>'
    return f'<triangles material="m">{entry}<p>{corners}</p></triangles>'


def dae_pieces(n: int) -> bytes:
    numbers = "0 0 0 1 0 0 0 1 0 " + "1 2 3 " * (4 * n)
    whole = collada(triangles() * n).decode()
    return whole.replace("0 0 0 1 0 0 0 1 0", numbers, 1).encode()


def dae_sources(n: int) -> bytes:
    accessor = '<accessor source="#pa" stride="3"/>'
    sources = (
        f'<source id="s{i}"><technique_common>{accessor}</technique_common></source>' for i in range(n)
    )
    parts = (triangles(source=f"#s{i}", semantic="POSITION") for i in range(n))
    whole = collada("".join([*sources, *parts])).decode()
    return whole.replace("0 0 0 1 0 0 0 1 0", "0 0 0 1 0 0 0 1 0 " + "1 2 3 " * n, 1).encode()


def dae_inputs(n: int) -> bytes:
    whole = collada(triangles() * n).decode()
    entry = '<input semantic="POSITION" source="#p"/>'
    return whole.replace(entry, entry * n, 1).encode()


def dae_nodes(n: int) -> bytes:
    library = f'<library_nodes><node id="n">{"<extra/>" * n}</node></library_nodes>'
    return collada(triangles(), '<instance_geometry url="#g"/>' + '<instance_node url="#n"/>' * n, library)


def dae_effects(n: int) -> bytes:
    params = "".join(f'<newparam sid="p{i}"/>' for i in range(n))
    shader = '<technique><phong><diffuse><texture texture="t"/></diffuse></phong></technique>'
    effect = f'<effect id="e"><profile_COMMON>{params}{shader}</profile_COMMON></effect>'
    own = '<material id="m{0}"><instance_effect url="#e"/></material>'
    library = f"<library_effects>{effect}</library_effects>" + "".join(own.format(i) for i in range(n))
    parts = "".join(triangles().replace('"m"', f'"m{i}"') for i in range(n))
    return collada(parts, library=f"<library_materials>{library}</library_materials>")


def dae_controllers(n: int) -> bytes:
    bind = f"<bind_shape_matrix>{'1 ' * n}</bind_shape_matrix>"
    skin = f'<controller id="c">{"<extra/>" * n}<skin source="#g">{bind}</skin></controller>'
    scene = '<instance_controller url="#c"/>' * n
    return collada(triangles(), scene, f"<library_controllers>{skin}</library_controllers>")


def dae_shown_again(n: int) -> bytes:
    return collada(triangles("0 1 2 " * n), '<instance_geometry url="#g"/>' * n)


def dae_bindings(n: int) -> bytes:
    bound = "".join(f'<instance_material symbol="s{i}" target="#m"/>' for i in range(n))
    inside = f"<bind_material><technique_common>{bound}</technique_common></bind_material>"
    library = f'<library_nodes><node id="n"><instance_geometry url="#g">{inside}</instance_geometry></node>'
    scene = '<instance_node url="#n"/>' * n
    return collada(triangles(), scene, f"{library}</library_nodes>")


def dae_image(n: int) -> bytes:
    """Effects that name one image, which hides its file behind other children."""
    image = f'<image id="i">{"<extra/>" * n}<init_from>{"x" * n}</init_from></image>'
    shader = '<technique><phong><diffuse><texture texture="i"/></diffuse></phong></technique>'
    effects = "".join(
        f'<effect id="e{i}"><profile_COMMON>{shader}</profile_COMMON></effect>'
        f'<material id="m{i}"><instance_effect url="#e{i}"/></material>'
        for i in range(n)
    )
    parts = "".join(triangles().replace('"m"', f'"m{i}"') for i in range(n))
    return collada(parts, library=f"<library_images>{image}</library_images>{effects}")


EFFECT = (
    "<transparent><color>1 1 1 1</color></transparent><transparency><float>0.5</float></transparency>"
    '<diffuse><texture texture="t"/></diffuse>'
)
POLYLIST = (
    cube_collada()
    .replace(b"<triangles", b"<polylist")
    .replace(b"</triangles>", b"</polylist>")
    .replace(b"<p>", b"<vcount>" + b"3 " * 12 + b"</vcount><p>")
)


# --- glTF


def scene_of(
    vertices: int, corners: int, primitives: list[dict[str, object]], inside: bool = False, **more: object
) -> bytes:
    """So many vertices and indices, in one buffer; `inside`: as text in the JSON."""
    positions = np.zeros((vertices, 3), "<f4")
    positions[: min(vertices, 3)] = np.eye(3)[: min(vertices, 3)]
    indices = (np.arange(corners) % 3).astype("<u4")
    binary = positions.tobytes() + indices.tobytes()
    buffer: dict[str, object] = {"byteLength": len(binary)}
    if inside:
        buffer["uri"] = "data:;base64," + base64.b64encode(binary).decode()
    views = [
        {"buffer": 0, "byteLength": positions.nbytes},
        {"buffer": 0, "byteOffset": positions.nbytes, "byteLength": indices.nbytes},
    ]
    accessors = [
        {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": vertices},
        {"bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": corners},
    ]
    document: dict[str, object] = {
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [buffer],
    }
    return pack_glb(document | more, b"" if inside else binary)


PRIMITIVE: dict[str, object] = {"attributes": {"POSITION": 0}, "indices": 1}


def glb_images(n: int) -> bytes:
    """Materials with the picture of one view."""
    data = png(n)
    primitives = [{**PRIMITIVE, "material": i} for i in range(n)]
    materials = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": i}}} for i in range(n)]
    whole = scene_of(
        3,
        3,
        primitives,
        materials=materials,
        textures=[{"source": i} for i in range(n)],
        images=[{"bufferView": 2} for _ in range(n)],
    )
    document = glb_document(whole)
    binary = whole[28 + int.from_bytes(whole[12:16], "little") :]
    document["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
    return pack_glb(document, binary + data)


def glb_points(n: int) -> bytes:
    points = [{"attributes": {}, "mode": 0}] * n
    nodes = [{"children": list(range(1, n + 1))}, *({"mesh": 0} for _ in range(n))]
    return scene_of(3, 3, [PRIMITIVE, *points], nodes=nodes)


def rich(document: dict[str, object]) -> None:
    """More of what a glTF may have."""
    at = {"mesh": 0, "rotation": [0, 0, 0, 1], "scale": [1, -1, 1]}
    document["nodes"] = [{"mesh": 0, "children": [1], "translation": [1, 2, 3]}, at]
    accessors, meshes, materials = (document[k] for k in ("accessors", "meshes", "materials"))
    accessors.append({"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 8})  # type: ignore[attr-defined]
    meshes[0]["primitives"][0]["attributes"]["COLOR_0"] = 2  # type: ignore[index]
    materials[0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}  # type: ignore[index]
    document["textures"], document["images"] = [{"source": 0}], [{"uri": "a.png"}]


PARSERS = (
    Parser(
        "collada",
        ("model.meshes.collada.read_collada", "model.urdf.xml_tree.read_xml", "model.text.read_text"),
        mesh_work("a.dae"),
        (ModelRefused,),
        (cube_collada(effect=EFFECT, node="<rotate>0 0 1 90</rotate>"), POLYLIST),
        {
            "surfaces of one source": Worst(dae_pieces, 100),
            "sources of one array": Worst(dae_sources, 100),
            "inputs": Worst(dae_inputs, 100),
            "a node many times": Worst(dae_nodes, 150),
            "an effect many times": Worst(dae_effects, 100),
            "an image many times": Worst(dae_image, 100),
            "a controller many times": Worst(dae_controllers, 100, SHOWN_AGAIN),
            "a mesh many times": Worst(dae_shown_again, 60, SHOWN_AGAIN),
            "bindings": Worst(dae_bindings, 100, SHOWN_AGAIN),
            "numbers": Worst(lambda n: collada(triangles("0 1 2 " * n)), 2000),
        },
    ),
    Parser(
        "gltf",
        ("model.meshes.gltf.read_gltf",),
        mesh_work("a.glb"),
        (ModelRefused,),
        (cube_glb(), cube_glb(rich)),
        {
            "surfaces of one buffer": Worst(lambda n: scene_of(20 * n, 3, [PRIMITIVE] * n), 100),
            "a buffer in the JSON": Worst(lambda n: scene_of(20 * n, 3, [PRIMITIVE] * n, True), 100),
            "indices many times": Worst(lambda n: scene_of(3, 3 * n, [PRIMITIVE] * n), 100, SHOWN_AGAIN),
            "a picture many times": Worst(glb_images, 48),
            "points": Worst(glb_points, 100, SHOWN_AGAIN),
        },
    ),
)
