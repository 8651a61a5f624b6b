"""Fetches robots' models, verifies them, and caches them in bounded memory."""
