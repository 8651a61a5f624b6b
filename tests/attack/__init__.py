"""Attacks on a real relay, while an innocent robot and viewer use it (`make attack`)."""
