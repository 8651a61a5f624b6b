"""Joins screenshots into one moving picture: python -m tools.moving_picture FOLDER OUT.webp --ms 100.

FOLDER holds PNG files, shown in the order of their names, each for the same time. `make pictures` calls it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from PIL import Image

QUALITY = 55
METHOD = 4  # of 0 (quickest) to 6 (smallest)
FRAMES_MAX = 200


def join_frames(folder: Path, out: Path, ms: int) -> int:
    """Write the PNG files in `folder` as an animated WebP that repeats forever, `ms` milliseconds a frame.
    Returns its size in bytes. Raises ValueError if there are none or too many, or if their sizes differ."""
    paths = sorted(folder.glob("*.png"))
    if not 1 <= len(paths) <= FRAMES_MAX:
        raise ValueError(f"{folder}: {len(paths)} PNG files; a moving picture has 1 to {FRAMES_MAX}")
    frames = []
    for path in paths:
        with Image.open(path) as image:
            frames.append(image.convert("RGB"))
        if frames[-1].size != frames[0].size:
            raise ValueError(f"{path}: {frames[-1].size} pixels, the first has {frames[0].size}")
    frames[0].save(
        out, save_all=True, append_images=frames[1:], duration=ms, loop=0, quality=QUALITY, method=METHOD
    )
    return out.stat().st_size


def main(arguments: list[str] | None = None) -> int:
    """Join the screenshots, and print the picture's size."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--ms", type=int, default=100, help="display time of each frame, ms (100)")
    args = parser.parse_args(arguments)
    try:
        size = join_frames(args.folder, args.out, args.ms)
    except ValueError as e:
        print(f"moving_picture: {e}", file=sys.stderr)
        return 2
    print(f"{args.out.stem}: {size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
