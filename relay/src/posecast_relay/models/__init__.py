"""Robots' models in this process: fetched, verified and kept in bounded memory."""
