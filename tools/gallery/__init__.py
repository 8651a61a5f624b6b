"""Builds every robot in some folders, and shows the results: pictures, costs, findings."""
