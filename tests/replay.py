"""Replay the reference results that an FMU carries by FMI-LS-REF.  Knows the standards and fmpy, and
nothing of the tool that made the FMU: python tests/replay.py FILE.fmu..."""

from __future__ import annotations

import csv
import io
import sys
import zipfile
from pathlib import PurePosixPath
from xml.etree import ElementTree as ET

import numpy as np
from runs import simulate_fmu

PLACE = "extra/org.fmi-standard.fmi-ls-ref/"
NAMESPACE = "{http://fmi-standard.org/fmi-ls-manifest}"


def replay(fmu: str, allowed: float = 1e-6) -> dict[str, float]:
    """Largest error of each column relative to its largest magnitude, over all experiments."""
    errors: dict[str, float] = {}
    with zipfile.ZipFile(fmu) as archive:
        manifest = ET.fromstring(archive.read(PLACE + "fmi-ls-manifest.xml"))
        assert manifest.tag == "fmiReferences"
        assert manifest.get(NAMESPACE + "fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
        related = {r.get("role"): r.get("source") for r in manifest.iter("Related")}
        sheet = next(s for r, s in related.items() if r.split("/")[0] == "experiment")
        for experiment in ET.fromstring(archive.read(PLACE + sheet)).iter("Experiment"):
            reference = experiment.find("References")
            text = archive.read(str(PurePosixPath(PLACE) / reference.get("source"))).decode()
            names, *rows = list(csv.reader(io.StringIO(text)))
            expected = dict(zip(names, np.array(rows, dtype=float).T, strict=True))
            step = float(experiment.get("stepSize"))
            result = simulate_fmu(
                fmu,
                start_time=float(experiment.get("startTime")),
                stop_time=float(experiment.get("stopTime")),
                step_size=step,
                output_interval=step,
                relative_tolerance=float(experiment.get("tolerance")),
                output=names[1:],
            )
            for name in names[1:]:
                column = result[name].astype(float)
                scale = np.abs(expected[name]).max() or 1.0
                worst = np.abs(column - expected[name]).max() / scale
                errors[name] = max(errors.get(name, 0.0), float(worst))
    assert all(e <= allowed for e in errors.values()), errors
    return errors


if __name__ == "__main__":
    for path in sys.argv[1:]:
        found = replay(path)
        print(f"{path}: {len(found)} columns, largest error {max(found.values()):.1e}")
