"""The examples: their stored outputs, and their types. `scripts/python.sh --all` runs the notebook."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest


@pytest.fixture
def notebook(root):
    path = root / "python" / "examples" / "dam.ipynb"
    return path, json.loads(path.read_text())["cells"]


def test_the_notebook_is_stored_with_what_it_shows(notebook):
    """People read it where nothing runs."""
    path, cells = notebook
    assert path.stat().st_size < 700_000
    outputs = [output for cell in cells if cell["cell_type"] == "code" for output in cell["outputs"]]
    assert not [output for output in outputs if output["output_type"] == "error" or output.get("name") == "stderr"]
    kinds = {kind for output in outputs for kind in output.get("data", ())}
    assert {"image/png", "text/html"} <= kinds, "pictures, and a film"
    for cell in cells:
        assert cell["cell_type"] != "code" or cell["execution_count"], cell["source"]


def test_examples_pass_pyright(root, notebook, tmp_path):
    pytest.importorskip("pyright")
    _, cells = notebook
    code = ("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    (tmp_path / "dam.py").write_text("\n\n".join(code))
    (tmp_path / "sph.py").write_text((root / "python" / "examples" / "sph.py").read_text())
    (tmp_path / "pyrightconfig.json").write_text('{"reportMissingModuleSource": false, "reportUnusedExpression": false}')
    done = subprocess.run(
        [sys.executable, "-m", "pyright", "--pythonpath", sys.executable], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_licences_of_all_crates_are_gathered(root):
    """As they are for the wheel."""
    if not (root / "Cargo.lock").exists():
        pytest.skip("not in the repository")
    done = subprocess.run(
        [sys.executable, root / "scripts" / "packaging" / "licences.py", "limpid-python"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    text = done.stdout
    for crate in ("wgpu ", "naga ", "pyo3 ", "numpy ", "exr ", "glam "):
        assert f"\n{crate}" in text, crate
    assert "limpid-io" not in text and "Copyright" in text and len(text) < 1_000_000
