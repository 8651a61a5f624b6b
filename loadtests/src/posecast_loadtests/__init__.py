"""Locust viewers that check what they are sent."""
