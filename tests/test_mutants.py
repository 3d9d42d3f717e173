"""The list of seeded defects (benchmarks/mutants.toml) belongs to the code as it is."""

from __future__ import annotations

import runpy
from pathlib import Path

ROOT = Path(__file__).parent.parent
DEFECTS, AIMED = runpy.run_path(str(ROOT / "benchmarks" / "mutants.py"))["read"]()


def test_each_defect_has_one_place() -> None:
    """Its text stands once in its file and becomes another, and each breaks something of its own."""
    for defect in DEFECTS:
        text = (ROOT / "lagfmu" / defect.file).read_text("utf-8")
        assert defect.made_in(text) != text
    assert len({d.breaks for d in DEFECTS}) == len(DEFECTS) >= 60
    assert len({(d.file, d.was, d.becomes) for d in DEFECTS}) == len(DEFECTS)


def test_what_is_aimed_at_a_defect_exists() -> None:
    """Tests, and models and scenes with the feature."""
    for test in {t for d in DEFECTS for t in (*d.tests, *AIMED[d.file])}:
        file, _, name = test.partition("::")
        assert not name or f"def {name}(" in (ROOT / "tests" / file).read_text("utf-8"), test
        assert (ROOT / "tests" / file).exists()
    for model in {d.stress for d in DEFECTS} - {""}:
        assert (ROOT / "models" / f"{model}.py").exists(), model
    for model, scene, *_ in {tuple(d.engines.split("/")) for d in DEFECTS if d.engines}:
        places = (ROOT / "models", ROOT / "tests" / "unseen")
        text = "".join(
            (p / f"{model}.py").read_text() for p in places if (p / f"{model}.py").exists()
        )
        assert f'Scene("{scene}"' in text, scene
