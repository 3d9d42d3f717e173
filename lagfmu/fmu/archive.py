"""The archive of an FMU: a zip file whose bytes depend on its contents only; and its files, unpacked."""

from __future__ import annotations

import importlib.metadata
import io
import shutil
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

from ..errors import TemporaryFolderError


def version() -> str:
    """The version of lagfmu that is installed."""
    return importlib.metadata.version("lagfmu")


def pack(contents: Mapping[str, bytes]) -> bytes:
    """A zip archive whose bytes depend on the contents only: fixed times, modes and order."""
    buffer = io.BytesIO()
    order = sorted(contents, key=lambda name: (name != "modelDescription.xml", name))
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in order:
            info = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            info.create_system = 3
            info.external_attr = 0o644 << 16
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(
                info, contents[name], compresslevel=9
            )  # that of `archive` is not taken
    return buffer.getvalue()


def unpack(fmu: Path) -> str:
    """A temporary folder with the files of an FMU, which the caller removes.  Raises TemporaryFolderError."""
    import fmpy

    folder = ""
    try:
        folder = tempfile.mkdtemp(prefix="lagfmu_")
        fmpy.extract(str(fmu), unzipdir=folder)
    except BaseException as error:
        shutil.rmtree(folder, ignore_errors=True)
        if isinstance(error, OSError):
            raise TemporaryFolderError(error) from None
        raise
    return folder
