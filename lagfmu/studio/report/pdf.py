"""A page of HTML as PDF, printed by a browser that is installed.

Firefox prints by WebDriver's Print alone: through Marionette, its own remote
protocol, a list [0, number, command, parameters] as JSON behind its length and a colon.
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import socket
import subprocess
import tempfile
import time
from pathlib import Path
from typing import IO, Any

from ...errors import BuildError

A4 = {"width": 21.0, "height": 29.7}  # cm
READY = 30.0  # s, until it listens


def _by_firefox(browser: str, page: Path, folder: Path, patience: float) -> bytes:
    """The bytes of the PDF; `folder` takes the profile, `patience` [s].  Raises OSError or TimeoutError."""
    profile = folder / "profile"
    profile.mkdir()
    (profile / "user.js").write_text('user_pref("marionette.port", 0);\n', encoding="utf-8")
    command = [browser, "--headless", "--marionette", "--no-remote", "--profile", str(profile)]
    quiet = subprocess.DEVNULL
    running = subprocess.Popen(command, stdout=quiet, stderr=quiet)
    try:
        port = _port(running, profile / "MarionetteActivePort")
        with socket.create_connection(("127.0.0.1", port), timeout=patience) as line:
            return _print(line, page)
    finally:
        running.terminate()
        try:
            running.wait(READY)
        except subprocess.TimeoutExpired:
            running.kill()
            running.wait()


def _port(running: subprocess.Popen[bytes], told: Path) -> int:
    """Where it listens, once it does."""
    end = time.monotonic() + READY
    while time.monotonic() < end:
        if told.is_file() and (text := told.read_text(encoding="utf-8").strip()):
            return int(text)
        if running.poll() is not None:
            raise OSError(f"it ended with {running.returncode}")
        time.sleep(0.05)
    raise TimeoutError(f"it did not listen within {READY:g} s")


def _print(line: socket.socket, page: Path) -> bytes:
    with line.makefile("rb") as answers:
        _read(answers)  # what it is
        wanted: tuple[tuple[str, dict[str, Any]], ...] = (
            ("WebDriver:NewSession", {}),
            ("WebDriver:Navigate", {"url": page.as_uri()}),
            ("WebDriver:Print", {"background": True, "page": A4}),
        )
        found: Any = None
        for number, (name, parameters) in enumerate(wanted):
            text = json.dumps([0, number, name, parameters]).encode()
            line.sendall(b"%d:%s" % (len(text), text))
            _, _, error, found = _read(answers)
            if error is not None:
                raise OSError(f"{name}: {error.get('message', error)}")
        return base64.b64decode(found["value"])


def _read(answers: IO[bytes]) -> Any:
    size = b""
    while (digit := answers.read(1)) != b":":
        if not digit:
            raise OSError("it ended before it answered")
        size += digit
    return json.loads(answers.read(int(size)))


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
                return _by_firefox(str(other), source, Path(folder), PATIENCE)
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
