"""Locust viewers that verify what they receive."""
