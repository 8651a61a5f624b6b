"""A URDF as typed values, and the files it names."""
