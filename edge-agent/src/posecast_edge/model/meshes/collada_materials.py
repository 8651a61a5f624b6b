"""Reads the materials of a Collada file.

An opacity of 0 is read as 1, because exporters often invert the specification's meaning.
"""

from __future__ import annotations

from collections.abc import Mapping

from posecast_edge.model.finding import ModelRefused, quote_name
from posecast_edge.model.meshes.collada_numbers import convert_float, extract_rgba
from posecast_edge.model.meshes.mesh import Load, Notes, Paint
from posecast_edge.model.meshes.texture import Pictures
from posecast_edge.model.urdf.xml_tree import Element

NAME_MAX = 4096  # characters
SHADERS = ("phong", "lambert", "blinn", "constant")


def find_target(ids: Mapping[str, Element], url: str | None) -> Element | None:
    """The element that the URL `#id` refers to, or None."""
    return ids.get(url[1:]) if url and url.startswith("#") else None


class Materials:
    """The materials of one file. A missing texture only gives a note."""

    def __init__(self, ids: Mapping[str, Element], load: Load, pictures: Pictures, notes: Notes) -> None:
        self._ids = ids
        self._load = load
        self._pictures = pictures
        self._notes = notes
        self._paints: dict[str, Paint | None] = {}  # by URL
        self._effects: dict[int, Paint | None] = {}

    def find_paint(self, url: str) -> Paint | None:
        """The paint of the material that a URL refers to; None if there is no such material or it has no
        paint."""
        if url not in self._paints:
            material = find_target(self._ids, url)
            instance = material.find_first("instance_effect") if material else None
            effect = find_target(self._ids, instance.get("url")) if instance else None
            self._paints[url] = self._of_effect(effect) if effect else None
        return self._paints[url]

    def _of_effect(self, effect: Element) -> Paint | None:
        """The paint of an effect, which is read once for all its materials."""
        if id(effect) not in self._effects:
            self._effects[id(effect)] = self._read_paint(effect)
        return self._effects[id(effect)]

    def _read_paint(self, effect: Element) -> Paint | None:
        profile = effect.find_first("profile_COMMON")
        technique = profile.find_first("technique") if profile else None
        shader = next((c for c in technique.children if c.tag in SHADERS), None) if technique else None
        if profile is None or shader is None:
            return None
        colour = shader.find_first("emission" if shader.tag == "constant" else "diffuse")
        alpha = self._opacity(shader)
        texture = colour.find_first("texture") if colour else None
        if texture is not None:
            picture = self._picture(profile, texture.get("texture") or "")
            return Paint((1.0, 1.0, 1.0, alpha) if picture else (0.8, 0.8, 0.8, alpha), picture)
        color = colour.find_first("color") if colour else None
        if color is None:
            return None
        r, g, b, _ = extract_rgba(color)
        return Paint((r, g, b, alpha))

    def _opacity(self, shader: Element) -> float:
        transparent = shader.find_first("transparent")
        amount = shader.find_first("transparency", "float")
        if transparent is None and amount is None:
            return 1.0
        color = transparent.find_first("color") if transparent else None
        r, g, b, a = extract_rgba(color) if color else (1.0, 1.0, 1.0, 1.0)
        factor = convert_float(amount.text if amount else None, 1.0)
        mode = (transparent.get("opaque") if transparent else None) or "A_ONE"
        light = 0.2126 * r + 0.7152 * g + 0.0722 * b
        alpha = {"RGB_ZERO": 1 - light * factor, "A_ZERO": 1 - a * factor, "RGB_ONE": light * factor}.get(
            mode, a * factor
        )
        if alpha < 0.02:
            self._notes.add("collada-opacity", "a material is fully transparent; read as opaque")
        return alpha if 0.02 <= alpha < 0.98 else 1.0

    def _picture(self, profile: Element, name: str) -> bytes | None:
        """Follow sampler → surface → image, or the image directly, as some exporters write it."""
        params = {p.get("sid") or "": p for p in profile.find_all("newparam")}
        for path in (("sampler2D", "source"), ("surface", "init_from")):
            param = params.get(name)
            inner = param.find_first(*path) if param else None
            if inner is not None:
                name = _name(inner)
        param = params.get(name)
        instance = param.find_first("sampler2D", "instance_image") if param else None  # 1.5
        image = find_target(self._ids, instance.get("url")) if instance else self._ids.get(name)
        source = image.find_first("init_from") if image else None
        ref = source.find_first("ref") if source else None
        file = _name(ref) if ref else _name(source) if source else name.strip()
        try:
            return self._pictures.validate(self._load(file))
        except ModelRefused as e:
            self._notes.add("texture", f"its texture {quote_name(file)}: {e.reason}")
            return None


def _name(element: Element) -> str:
    """The name of a file or parameter, cut to NAME_MAX: many elements may refer to one huge text."""
    return element.text[:NAME_MAX].strip()
