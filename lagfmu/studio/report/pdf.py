"""A page of HTML as PDF, printed by a browser that is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from ...errors import BuildError
from . import firefox

CHROMIUM = ("chromium", "chromium-browser", "google-chrome", "chrome", "msedge")
FIREFOX = ("firefox", "firefox-esr")
PATIENCE = 120.0  # s


def printed(page: str, what: str) -> bytes:
    """The bytes of a PDF.  Raises BuildError without a browser that prints."""
    browser = os.environ.get("CHROMIUM") or _installed(*CHROMIUM)
    other = _installed(*FIREFOX)
    if browser is None and other is None:
        raise BuildError(
            f"{what!r}: a PDF needs Chromium, Chrome or Firefox, and none was found (CHROMIUM names one of "
            "the first two elsewhere): write a .html file, and print it from any browser"
        )
    with tempfile.TemporaryDirectory(prefix="lagfmu_", ignore_cleanup_errors=True) as folder:
        source, target = Path(folder, "report.html"), Path(folder, "report.pdf")
        source.write_text(page, encoding="utf-8")
        if browser is None:
            try:
                return firefox.printed(str(other), source, Path(folder), PATIENCE)
            except OSError as error:  # TimeoutError is one
                raise BuildError(f"{other!r} cannot print the report: {error}") from None
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


def _installed(*browsers: str) -> str | None:
    return next(filter(None, map(shutil.which, browsers)), None)
