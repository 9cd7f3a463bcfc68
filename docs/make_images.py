"""Makes the picture of the README: the report of the demo flight, as a browser shows it.

Run `python docs/make_images.py` with aerofdi installed and Chromium or Chrome on the path. Simulated flight only.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from aerofdi import diagnose, fly
from aerofdi.report import write_html

HERE = Path(__file__).parent / "images"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
WIDTH, HEIGHT = 1120, 975
# The picture shows the panels that decide; the page has all.
LEFT_OUT = ("Attitude", "Pitch rate", "Yaw rate")


def browser() -> str:
    """The first browser there is."""
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        sys.exit(
            f"docs/make_images.py needs a browser to make the picture; install one of {', '.join(BROWSERS)}"
        )
    return found


def picture(page: Path, target: Path, home: str) -> None:
    """The top of a page as PNG. home: an empty folder for the browser's own files."""
    hidden = ", ".join(f'.panel:has(canvas[aria-label^="{name}"])' for name in LEFT_OUT)
    text = page.read_text(encoding="utf-8").replace("</style>", f"{hidden} {{ display: none; }}</style>", 1)
    page.write_text(text, encoding="utf-8")
    run = [
        browser(), "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--user-data-dir={home}",
        f"--window-size={WIDTH},{HEIGHT}", "--virtual-time-budget=4000", f"--screenshot={target}", page.as_uri(),
    ]  # fmt: skip
    subprocess.run(run, check=True, capture_output=True, timeout=300)


def main() -> None:
    """Fly, diagnose, write the page, take its picture."""
    HERE.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        page = write_html(diagnose([fly("demo")]), Path(folder) / "report.html")
        new = Path(folder) / "report.png"
        picture(page, new, os.path.join(folder, "browser"))
        shutil.move(new, HERE / "report.png")
    print(f"{HERE / 'report.png'}: {(HERE / 'report.png').stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
