"""Draws the page's icons from its one SVG: python tools/icons.py (needs Chromium and Pillow).

Home screens crop a square to their own shape, so these have no round corners.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

from PIL import Image

PUBLIC = Path(__file__).resolve().parent.parent / "spa/public"
SIZES_PX = {"apple-touch-icon.png": 180, "icon-192.png": 192, "icon-512.png": 512}
COLORS_MAX = 32  # two colours, and the blends at edges
ROUND = 'rx="8"'


def draw_icon(svg: str, size_px: int, target: Path) -> None:
    """Write a PNG of `size_px` by `size_px`. Raises CalledProcessError if Chromium fails."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("icons: needs chromium (apt-get install chromium)")
    with tempfile.TemporaryDirectory() as folder:
        page, shot = Path(folder, "icon.html"), Path(folder, "icon.png")
        page.write_text(f"<style>body{{margin:0}}svg{{display:block;width:{size_px}px}}</style>{svg}")
        window = f"--window-size={size_px},{size_px + 200}"  # Chromium enlarges a low window
        command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", window]
        subprocess.run(
            [*command, f"--screenshot={shot}", page.as_uri()], check=True, timeout=60, capture_output=True
        )
        with Image.open(shot) as drawn:
            icon = drawn.convert("RGB").crop((0, 0, size_px, size_px))
        icon.quantize(COLORS_MAX).save(target, optimize=True)


def main() -> None:
    """Draw them all."""
    svg = (PUBLIC / "favicon.svg").read_text()
    assert ROUND in svg
    for name, size_px in SIZES_PX.items():
        draw_icon(svg.replace(ROUND, ""), size_px, PUBLIC / name)
        print(f"{name}: {(PUBLIC / name).stat().st_size} bytes")


if __name__ == "__main__":
    main()
