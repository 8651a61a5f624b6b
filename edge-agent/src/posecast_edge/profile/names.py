"""Reads a profile's [names] table: display names of channels and sites, also per language."""

from __future__ import annotations

from collections.abc import Collection

from posecast_edge.profile.values import Values


def read_names(
    values: Values, value: object, known: Collection[str]
) -> tuple[dict[str, str], dict[str, dict[str, str]]]:
    """Parse [names] into channel or site → display name, and its subtables ([names.ko]) into language →
    channel or site → display name. Raises ProfileError, which names the line."""
    names: dict[str, str] = {}
    translated: dict[str, dict[str, str]] = {}
    for key, entry in values.check_table(value, "names").items():
        at = f"names.{key}"
        if isinstance(entry, dict):
            values.check_language(key, at, translated)
            translated[key] = {k: _words(values, k, v, known, f"{at}.{k}") for k, v in entry.items()}
        else:
            names[key] = _words(values, key, entry, known, at)
    return names, translated


def _words(values: Values, name: str, words: object, known: Collection[str], where: str) -> str:
    values.check_choice(name, known, "channel or site", where)
    return values.check_words(words, where)
