"""What the commands print on: a console that never crops, on any width and in any encoding."""

from __future__ import annotations

import codecs
import contextlib
import logging
import sys
import unicodedata
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.markup import escape

from ..errors import LagfmuError, TemporaryFolderError, UserInterruptError
from ..verification.pipeline import code_of

console = Console(emoji=False)  # "0.2:x:3" is what the user wrote
errors = Console(stderr=True, emoji=False)

PLAIN = {"≤": "<=", "≥": ">=", "−": "-", "–": "-", "→": "->", "●": "*", "µ": "u", "√": "sqrt"}
ACCENTS = {"\u0307": "'", "\u0308": "''"}  # combining dots: derivatives


def spelled(text: str) -> str:
    """A text in ASCII as far as there are words for it: lambda for λ, theta' for θ̇, <= for ≤."""
    return "".join(_spelled(c) for c in text)


def _spelled(letter: str) -> str:
    known = PLAIN.get(letter) or ACCENTS.get(letter)
    if known:
        return known
    parts = unicodedata.normalize("NFKD", letter)
    if len(parts) > 1:
        return spelled(parts)
    name = unicodedata.name(letter, "")
    if name.startswith("GREEK "):
        word = name.split(" WITH ")[0].split()[-1].lower().replace("lamda", "lambda")
        return word.capitalize() if "CAPITAL" in name else word
    return letter if letter.isascii() else "?"


def _replace(error: UnicodeError) -> tuple[str, int]:
    """Error handler of a codec; see `spelled`."""
    assert isinstance(error, UnicodeEncodeError)
    return spelled(error.object[error.start : error.end]), error.end


codecs.register_error("lagfmu.spelled", _replace)


def prepare_streams() -> None:
    """Let stdout and stderr spell out what their encoding (cp1252, ASCII) does not have."""
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="lagfmu.spelled")


def say(text: str, word: str = "", colour: str = "green", on: Console = console) -> None:
    """One message as it is, on one line however narrow the console, behind a word in a colour."""
    on.print(f"[{colour}]{word}[/] " * bool(word) + escape(text), highlight=False, soft_wrap=True)


def say_wrote(path: Path, more: str = "", word: str = "wrote", on: Console = console) -> None:
    """A file stands at `path`."""
    say(f"{path}{more}", word, on=on)


def kilobytes(path: Path) -> str:
    """The size of a file, in brackets."""
    return f" ({path.stat().st_size / 1e3:.0f} kB)"


def say_error(text: str) -> None:
    """One message on stderr."""
    say(text, "error:", "bold red", errors)


class _Notes(logging.Handler):
    """What the program tells besides, a line each, once."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self.told: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        """Print it, if it was not."""
        text = record.getMessage()
        if text not in self.told:
            say(text, "note:", "cyan", errors)
        self.told.add(text)


@contextlib.contextmanager
def _noted() -> Iterator[None]:
    log, notes = logging.getLogger("lagfmu"), _Notes()
    before = log.level
    log.addHandler(notes)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.removeHandler(notes)
        log.setLevel(before)


@contextlib.contextmanager
def plainly() -> Iterator[None]:
    """Notes, warnings and errors as one message each; an error ends the command with its exit code."""
    with _noted(), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            try:
                yield
            finally:  # before the error that may follow from what they tell
                for message in dict.fromkeys(str(w.message) for w in caught if _ours(w)):
                    say(message, "warning:", "yellow", errors)
        except (LagfmuError, OSError) as raised:
            error = raised if isinstance(raised, LagfmuError) else TemporaryFolderError(raised)
            if isinstance(error, UserInterruptError):
                say(str(error), on=errors)
            else:
                say_error(str(error))
            raise typer.Exit(code_of(error)) from None


def _ours(warning: Any) -> bool:
    return str(getattr(warning.category, "__module__", "")).startswith("lagfmu")
