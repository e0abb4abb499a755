"""Pictures of a report's first screen and of all of it: at a desk and on a phone, light and dark.

    python tools/screenshots.py report.html [folder]

Needs playwright and a Chromium (``apt-get install chromium``).
"""

from __future__ import annotations

import itertools
import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

SIZES = {"desk": (1280, 800), "phone": (390, 844)}
NAMES = ("chromium", "chromium-browser", "google-chrome")


def pictures(page: Path, folder: Path) -> list[Path]:
    """The pictures of a page, written into a folder; a message of the page's own scripts ends it."""
    folder.mkdir(parents=True, exist_ok=True)
    program = next(filter(None, map(shutil.which, NAMES)), None)
    written = []
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=["--no-sandbox", "--disable-gpu"])
        for (size, (width, height)), theme in itertools.product(SIZES.items(), ("light", "dark")):
            shown = browser.new_page(viewport={"width": width, "height": height}, color_scheme=theme)
            wrong: list[str] = []
            shown.on("pageerror", lambda error, wrong=wrong: wrong.append(str(error)))
            shown.on("console", lambda told, wrong=wrong: wrong.append(told.text) if told.type == "error" else None)
            shown.goto(page.resolve().as_uri())
            shown.wait_for_timeout(200)
            for name, whole in (("first", False), ("folded", True)):
                written.append(folder / f"{page.parent.name}-{page.stem}-{size}-{theme}-{name}.png")
                shown.screenshot(path=written[-1], full_page=whole)
            if wrong:
                raise SystemExit(f"{page}: {'; '.join(wrong)}")
            shown.close()
        browser.close()
    return written


if __name__ == "__main__":
    for picture in pictures(Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "screenshots")):
        print(picture)
