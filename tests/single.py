"""One instance by single calls through ctypes, of either version of FMI."""

from __future__ import annotations

from typing import Any

OK, WARNING, DISCARD, ERROR, FATAL = range(5)


class Caller:
    """Calls on `handle` in the dll of `library`; `log`: status, category and text of each message.

    `broken`: what went wrong where the FMU called back, which ctypes would only print.
    """

    version: int
    library: Any
    handle: Any

    def __init__(self) -> None:
        self.log: list[tuple[int, str, str]] = []
        self.broken: BaseException | None = None

    def call(self, function: str, *arguments: Any) -> int:
        """The status of the function of FMI, whose name is given without the version."""
        found = getattr(self.library.dll, f"fmi{self.version}{function}")
        status: int = found(self.handle, *arguments)
        if self.broken is not None:
            raise self.broken
        return status

    def does(self, function: str, *arguments: Any) -> None:
        """The call succeeds."""
        status = self.call(function, *arguments)
        assert status == OK, (function, status, self.log[-1:])

    def refuses(self, function: str, *arguments: Any, status: int = ERROR) -> str:
        """The call returns `status`; its reason."""
        count = len(self.log)
        assert self.call(function, *arguments) == status, (function, self.log[count:])
        assert len(self.log) == count + 1, (function, self.log[count:])
        assert self.log[-1][0] == status
        return self.log[-1][2]
