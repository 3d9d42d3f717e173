"""docs/pipelines.md: its recipes keep their servers' schemas, and their commands run."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from conftest import MODELS
from junitparser import JUnitXml
from typer.testing import CliRunner

from lagfmu.testing import app

PAGE = (Path(__file__).parent.parent / "docs" / "pipelines.md").read_text(encoding="utf-8")
GITHUB, GITLAB = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
JENKINS = re.search(r"```groovy\n(.*?)```", PAGE, re.DOTALL)[1]
COMMANDS = {
    "github": [s["run"] for s in yaml.safe_load(GITHUB)["jobs"]["verify"]["steps"] if "run" in s],
    "gitlab": yaml.safe_load(GITLAB)["verify"]["script"],
    "jenkins": re.findall(r"sh '([^']*)'", JENKINS),
}


@pytest.mark.parametrize(
    ("recipe", "schema"), [(GITHUB, "vendor.github-workflows"), (GITLAB, "vendor.gitlab-ci")]
)
def test_a_recipe_keeps_the_schema_of_its_server(recipe, schema, tmp_path):
    """The schemas that check-jsonschema carries; a step of a wrong kind is found."""
    pytest.importorskip("check_jsonschema", reason="pip install -e '.[test]'")
    for text, code in ((recipe, 0), (recipe.replace("verify:", "verify: 3\nrest:", 1), 1)):
        (tmp_path / "recipe.yml").write_text(text)
        words = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", schema]
        done = subprocess.run([*words, tmp_path / "recipe.yml"], capture_output=True, check=False)
        assert done.returncode == code, done.stdout.decode()


def test_jenkins_recipe_is_balanced():
    """Each bracket is closed, in the order of Groovy; the three servers run the same commands."""
    depth = [JENKINS.count(a) - JENKINS.count(b) for a, b in ("{}", "()")]
    assert depth == [0, 0]
    assert JENKINS.count("'") % 2 == 0
    own = [c.replace(".venv/bin/", "") for c in COMMANDS["jenkins"]]
    for words in COMMANDS.values():
        ours = [c.replace(".venv/bin/", "") for c in words if "lagfmu " in c and "pip" not in c]
        assert ours == [c for c in own if c.startswith("lagfmu")]


def test_the_commands_run_as_they_stand(tmp_path, monkeypatch):
    """In a repository with the model and the statements of the page: all hold; with a bound that does not
    hold the last command ends with 1, and still writes JUnit's XML and the page."""
    monkeypatch.chdir(tmp_path)
    Path("models").mkdir()
    shutil.copy(MODELS / "hemisphere.py", "models")
    claims = Path("claims", "hemisphere.toml")
    claims.parent.mkdir()
    claims.write_text(re.search(r"```toml\n(.*?)```", PAGE, re.DOTALL)[1])
    commands = [shlex.split(c)[1:] for c in COMMANDS["github"] if c.startswith("lagfmu ")]
    assert len(commands) == 2
    for command in commands:
        done = CliRunner().invoke(app, command)
        assert done.exit_code == 0, done.output
    claims.write_text(claims.read_text() + '[[bounds]]\nof = "theta"\nat_most = 0.5\n')
    assert CliRunner().invoke(app, commands[-1]).exit_code == 1
    assert JUnitXml.fromfile("verify.xml").failures == 1
    assert "Missed: theta &lt;= 0.5" in Path("verify.html").read_text(encoding="utf-8")
