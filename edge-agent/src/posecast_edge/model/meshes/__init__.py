"""Reads mesh and texture files of any format as triangles with paints."""
