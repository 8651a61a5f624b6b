"""Mesh and texture files of any format as triangles with paints."""
