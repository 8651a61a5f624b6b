"""Builds a bundle from a URDF: visuals, levels of detail, thumbnail, manifest."""
