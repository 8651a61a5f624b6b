"""Fetches robots' models, verifies them, and keeps them in bounded memory."""
