"""Make the pictures (PNG) of the page in docs: on a computer, on a phone, and with a map."""

from __future__ import annotations

import tempfile
from pathlib import Path

from PIL import Image

from prove.picture import PIPELINE
from tests.support.browser import Browser, Page
from tests.support.page_server import serving
from tests.support.running import running

COLOURS = 200  # of the pictures, at half of the size
DESKTOP_SIZE, PHONE_SIZE = (1100, 780), (390, 760)  # CSS pixels
# Both wheels in one panel and the position in another.
VIEW = """format: 1
kind: view
panel: plots
plots: {fields: [gate.wheels.left, gate.wheels.right, odometry.odometry.x], span: 10 s}
"""

WANDERING = """format: 1
kind: pipeline
include: map
blocks:
  wander: {block: wander, in: {scan: robot.scan, odometry: odometry.odometry}}
  mux: {in: {autonomous: wander.twist}}
"""
MAPPED = "parseFloat(document.getElementById('time').textContent) > 40"  # s
ON_THE_WAY = (
    "(text => text.includes('driving') && text.includes('1.100'))"  # to the second goal
    "(document.getElementById('facts').textContent)"
)
HAVE_DATA = (
    "[...document.querySelectorAll('#plots output')].every(e => e.textContent !== 'no data')"
)


def main() -> None:
    """Draw the pictures."""
    with tempfile.TemporaryDirectory() as name, Browser(Path(name) / "profile") as browser:
        folder = Path(name)
        (folder / "view.yaml").write_text(VIEW)
        with running(folder, str(PIPELINE), "--stay", sets=(), name="picture"):
            with serving(folder) as server:
                desktop, phone = browser.open_page(), browser.open_page()
                desktop.resize(DESKTOP_SIZE)
                phone.emulate_phone(PHONE_SIZE)
                for page in (desktop, phone):
                    page.open(server.next_link())
                for page, file in ((desktop, "docs/page.png"), (phone, "docs/page_phone.png")):
                    page.until(ON_THE_WAY)
                    _write(page, Path(file))
            with serving(folder, "--view", str(folder / "view.yaml")) as server:
                inside = browser.open_page()
                inside.resize(DESKTOP_SIZE)
                inside.open(server.next_link())
                inside.until("document.querySelectorAll('#plots figure').length === 2")
                inside.until("document.getElementById('blocks').textContent.includes('odometry')")
                inside.until(HAVE_DATA)
                inside.evaluate("document.getElementById('plot-keys').scrollIntoView()")
                _write(inside, Path("docs/page_inside.png"))
        (folder / "flat.yaml").write_text(WANDERING)
        with serving(folder, run=(str(folder / "flat.yaml"),)) as server:
            page = browser.open_page()
            page.resize(DESKTOP_SIZE)
            page.open(server.next_link())
            page.until(MAPPED)
            _write(page, Path("docs/page_map.png"))


def _write(page: Page, path: Path) -> None:
    page.screenshot(path)
    Image.open(path).convert("RGB").quantize(COLOURS).save(path, optimize=True)


if __name__ == "__main__":
    main()
