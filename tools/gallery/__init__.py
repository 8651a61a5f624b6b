"""Builds every robot in some folders, and shows what became of it: pictures, costs, findings."""
