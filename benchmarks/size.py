"""How large are native FMUs, and what are their bytes?

    python benchmarks/size.py [--all] [MODEL ...]

A row a model of models/ (default: one of each kind): kB of the whole archive, and packed in it the binary for
this machine, the sources, and all else (description, documentation, records, the archive's own).  --all: with
the binaries for every platform, each in a column (ziglang; the first build for Windows takes its time).
"""

from __future__ import annotations

import argparse
import tempfile
import zipfile
from collections import Counter
from pathlib import Path

from lagfmu import build_fmu
from lagfmu.fmu.compiler import ALL, HOST, NAMES, host
from lagfmu.model.file import load

MODELS = Path(__file__).parent.parent / "models"
KINDS = ("pendulum", "chain", "bouncing_ball", "hemisphere", "friction_oscillator")


def packed(path: Path) -> dict[str, float]:
    """kB of the archive by what they are for: 'sources', 'rest', and a platform each."""
    found: Counter[str] = Counter()
    with zipfile.ZipFile(path) as archive:
        for file in archive.infolist():
            folder, _, inside = file.filename.partition("/")
            place = inside.split("/")[0] if folder == "binaries" else folder
            found[place if place in (*NAMES, "sources") else "rest"] += file.compress_size
    found["rest"] += path.stat().st_size - sum(found.values())
    return {place: size / 1e3 for place, size in found.items()}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="*", default=KINDS)
    parser.add_argument("--all", action="store_true", help="binaries for every platform")
    asked = parser.parse_args()
    platforms = NAMES if asked.all else (host().folder,)
    print("| kB | whole | " + " | ".join(platforms) + " | sources | rest |")
    print("| --- |" + " --- |" * (len(platforms) + 3))
    with tempfile.TemporaryDirectory() as out:
        for name in asked.models:
            file = load(MODELS / f"{name}.py")
            path = build_fmu(
                file.model,
                out,
                file.scenes[0],
                target="native",
                platforms=(ALL if asked.all else HOST,),
                check=False,
            )
            sizes = packed(path)
            row = [sizes[place] for place in (*platforms, "sources", "rest")]
            print(f"| {name} | {sum(row):.0f} | " + " | ".join(f"{x:.1f}" for x in row) + " |")


if __name__ == "__main__":
    main()
