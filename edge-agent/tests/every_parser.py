"""All parsers of this package, by name."""

from __future__ import annotations

import itertools

import mesh_parsers
import message_parsers
import model_parsers
import recording_parsers
import scene_parsers
import sdf_parsers
import settings_parsers

PARSERS = {
    parser.name: parser
    for parser in itertools.chain(
        mesh_parsers.PARSERS,
        scene_parsers.PARSERS,
        model_parsers.PARSERS,
        sdf_parsers.PARSERS,
        recording_parsers.PARSERS,
        message_parsers.PARSERS,
        settings_parsers.PARSERS,
    )
}
