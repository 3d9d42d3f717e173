"""A page as PDF by Firefox, which prints by WebDriver's Print alone: through Marionette, its own remote
protocol, a list [0, number, command, parameters] as JSON behind its length and a colon."""

from __future__ import annotations

import base64
import json
import socket
import subprocess
import time
from pathlib import Path
from typing import IO, Any

A4 = {"width": 21.0, "height": 29.7}  # cm
READY = 30.0  # s, until it listens


def printed(browser: str, page: Path, folder: Path, patience: float) -> bytes:
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
