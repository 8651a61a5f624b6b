"""Attacks on a real relay with an innocent robot and viewer beside (`make attack`)."""
