"""Prints the demo robot's readings at seconds of its motion, one line each, in the format of `jsonl`."""

from __future__ import annotations

import json
import math
import sys

from posecast_edge.profile.reader import load_profile
from posecast_edge.sources.demo import BUNDLE, PROFILE, read_motion

motion = read_motion((BUNDLE / "motion.bin").read_bytes())
profile = load_profile(PROFILE)
for second in sys.argv[1:]:
    sample = motion.make_sample(round(float(second) * motion.rate_hz))
    values: dict[str, dict[str, float | None]] = {}
    for name, readings in sample.values.items():
        spec = profile.find_field(name)
        if spec is None or not isinstance(readings, list):
            continue
        values[name] = {
            label: None if value is None or (isinstance(value, float) and math.isnan(value)) else value
            for label, value in zip(spec.labels, readings, strict=True)
        }
    print(json.dumps(values))
