"""Builds the guide: a static site that uses no other origin and works under any path, or opened from files.

python -m tools.site [--out FOLDER]: out/site by default. Warnings from Zensical are errors. The recordings of
the gallery and their player are added, from the demo robot and the built page (tools/site/moments).
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from posecast_edge.model.serve.bundle import ModelError
from posecast_relay.config.settings import find_page

from tools.site.moments.gallery import PAGE, add_gallery
from tools.site.moments.simulated_relay import RecordingFailed
from tools.site.navigation import make_navigation
from tools.site.notices import list_notices
from tools.site.python_page import write_python_page
from tools.site.routes_page import read_description, write_routes
from tools.site.staging import stage_pages

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
SHIM = "node_modules/iframe-worker/shim/index.js"
COLOURS = re.compile(r"\x1b\[[0-9;]*m")
AS_IT_IS = re.compile(r"(<pre\b.*?</pre>|<script\b.*?</script>)", re.DOTALL)
INDENTED = re.compile(r"\s*\n\s*")
BREADCRUMBS = (
    '<nav class="md-path" aria-label="Navigation"',
    '<nav class="md-path" aria-label="Breadcrumbs"',
)
UNUSED = ("assets/stylesheets/classic", "assets/images")

# the generator's script must work with a strict Content-Security-Policy, one search index and screen readers
# it inserts the style of its search dialog as an element, which the Content-Security-Policy forbids
STYLE_ELEMENT = re.compile(
    r"(?P<root>\w+)\.appendChild\(\w+\(\"style\",\{\},(?P<style>\w+)\.toString\(\)\)\)"
)
STYLE_SHEET = r"(s=>{s.replaceSync(\g<style>.toString());\g<root>.adoptedStyleSheets=[s]})(new CSSStyleSheet)"
# pages opened from files read the index as a script; others fetch the same as JSON
READS_SCRIPT = re.compile(r'location\.protocol==="file:"(?=\?\w+\(`\$\{new URL\("search\.js")')
ALWAYS = "!0"
# the buttons of each code block were a landmark without a name
CODE_BUTTONS = re.compile(r'\("nav",(?=\{class:"md-code__nav"\})')
INDEX_AS_JSON = "search.json"


class SiteError(Exception):
    """The build failed; the message says what is wrong on which page."""


def build(out: Path) -> None:
    """Build the guide into the folder `out`, which is replaced. Raises SiteError."""
    with TemporaryDirectory() as folder:
        site = _build_within(Path(folder))
        shutil.rmtree(out, ignore_errors=True)
        out.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(site, out)


def _build_within(stage: Path) -> Path:
    pages = stage / "docs"
    stage_pages(ROOT, pages)
    (pages / "reference/routes.md").write_text(write_routes(read_description()), encoding="utf-8")
    (pages / "reference/python-api.md").write_text(write_python_page(ROOT), encoding="utf-8")
    shutil.copytree(HERE / "overrides", stage / "overrides")
    shutil.copytree(HERE / "look", pages / "look")
    shutil.copyfile(ROOT / SHIM, pages / "look" / "iframe-worker.js")
    shutil.copyfile(ROOT / "spa/public/favicon.svg", pages / "look" / "favicon.svg")
    settings = (ROOT / "zensical.toml").read_text(encoding="utf-8")
    nav = _write_toml(make_navigation(pages))
    (stage / "zensical.toml").write_text(settings.replace("[project]\n", f"[project]\nnav = {nav}\n", 1))
    command = [str(Path(sys.executable).parent / "zensical"), "build", "--strict"]
    done = subprocess.run(command, cwd=stage, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SiteError(COLOURS.sub("", done.stdout + done.stderr.partition("Traceback")[0]))
    change_script(stage / "site")
    for name in UNUSED:
        path = stage / "site" / name
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    _name_breadcrumbs(stage / "site")
    _drop_indents(stage / "site")
    bundle = (stage / "site/assets/javascripts/LICENSE").read_text(encoding="utf-8")
    if (stage / "site" / PAGE).is_file():
        _add_gallery(stage / "site")
    notices = json.dumps(list_notices(ROOT, bundle), indent=1)
    (stage / "site/licenses.json").write_text(notices, encoding="utf-8")
    return stage / "site"


def change_script(site: Path) -> None:
    """Make the script adopt its style as a sheet, always read the index as a script and show a code block's
    buttons in no landmark; remove the JSON index. Raises ValueError if the script is not the expected one.
    """
    (script,) = (site / "assets/javascripts").glob("bundle.*.js")
    text = script.read_text(encoding="utf-8")
    changes = ((STYLE_ELEMENT, STYLE_SHEET), (READS_SCRIPT, ALWAYS), (CODE_BUTTONS, '("div",'))
    for pattern, instead in changes:
        text, count = pattern.subn(instead, text)
        if count != 1:
            raise ValueError(f"{script.name}: {count} of {pattern.pattern}, expected 1; did Zensical change?")
    script.write_text(text, encoding="utf-8")
    (site / INDEX_AS_JSON).unlink()


def _add_gallery(site: Path) -> None:
    page = find_page()
    if page is None:
        raise SiteError("the gallery needs the built page: make setup\n")
    try:
        add_gallery(site, page)
    except (RecordingFailed, ModelError) as e:
        raise SiteError(f"{e}\n") from None


def _name_breadcrumbs(site: Path) -> None:
    """Tell the breadcrumbs from the side bar, which has the same label."""
    for page in site.rglob("*.html"):
        page.write_text(page.read_text(encoding="utf-8").replace(*BREADCRUMBS), encoding="utf-8")


def _drop_indents(site: Path) -> None:
    """Remove the templates' indentation, a quarter of a page's size; code keeps its own."""
    for page in site.rglob("*.html"):
        parts = AS_IT_IS.split(page.read_text(encoding="utf-8"))
        parts[::2] = [INDENTED.sub("\n", part) for part in parts[::2]]
        page.write_text("".join(parts), encoding="utf-8")


def _write_toml(value: object) -> str:
    """Texts, lists and tables as one line of TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {_write_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_write_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "site", help="output folder (out/site)")
    try:
        build(parser.parse_args().out.resolve())
    except SiteError as e:
        raise SystemExit(f"{e}the guide was not built") from None


if __name__ == "__main__":
    main()
