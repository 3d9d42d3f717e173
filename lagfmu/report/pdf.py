"""A page of HTML as PDF, printed by a browser that is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from ..errors import BuildError

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge")
PATIENCE = 120.0  # s


def printed(page: str, what: str) -> bytes:
    """The bytes of a PDF.  Raises BuildError without a browser that prints."""
    browser = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise BuildError(
            f"{what!r}: a PDF needs Chromium or Chrome, and none was found (CHROMIUM names one elsewhere): "
            "write a .html file, and print it from any browser"
        )
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
        source, target = Path(folder, "report.html"), Path(folder, "report.pdf")
        source.write_text(page, encoding="utf-8")
        command = [
            browser,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            f"--user-data-dir={folder}/profile",
            "--no-pdf-header-footer",
            f"--print-to-pdf={target}",
            source.as_uri(),
        ]
        try:
            done = subprocess.run(command, capture_output=True, timeout=PATIENCE, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise BuildError(f"{browser!r} cannot print the report: {error}") from None
        if not target.is_file():
            said = done.stderr.decode(errors="replace").strip().splitlines()
            raise BuildError(
                f"{browser!r} cannot print the report: {said[-1] if said else 'no reason'}"
            )
        return target.read_bytes()
