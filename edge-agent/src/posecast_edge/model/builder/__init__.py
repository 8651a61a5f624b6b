"""From a URDF to a bundle: visuals, levels of detail, thumbnail, manifest."""
