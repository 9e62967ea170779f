"""What can be told of the extension without Slicer's application: its files agree with each other."""

from __future__ import annotations

import ast
import json
import re
import struct
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PLUGIN = ROOT / "plugin"
MODULE = PLUGIN / "PalpateStiffness"
SOURCE = (MODULE / "PalpateStiffness.py").read_text()
UI = ET.parse(MODULE / "Resources" / "UI" / "PalpateStiffness.ui").getroot()
sys.path.insert(0, str(MODULE))

from PalpateStiffnessLib.errors import InputError  # noqa: E402
from PalpateStiffnessLib.logic import METHODS  # noqa: E402
from PalpateStiffnessLib.sample import sample_pair  # noqa: E402

from palpate.core.identify.options import METHODS as PROGRAM_METHODS  # noqa: E402


def parameters() -> set[str]:
    """The fields of the parameter node."""
    tree = ast.parse(SOURCE)
    node = next(n for n in tree.body if isinstance(n, ast.ClassDef) and n.name == "PalpateStiffnessParameterNode")
    return {
        each.target.id for each in node.body if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name)
    }


def test_the_panel_has_every_widget_that_the_code_names() -> None:
    names = {widget.get("name") for widget in UI.iter("widget")}
    used = set(re.findall(r"self\.ui\.(\w+)", SOURCE)) | set(re.findall(r'"(\w+Button)"', SOURCE))
    assert used and used <= names, used - names


def test_every_parameter_is_bound_to_a_widget() -> None:
    bound = [p.findtext("string") for p in UI.iter("property") if p.get("name") == "SlicerParameterName"]
    assert sorted(bound) == sorted(parameters())
    assert METHODS == PROGRAM_METHODS


def test_every_parameter_has_a_type_that_its_widget_takes() -> None:
    """As Slicer's parameterNodeWrapper binds them: a path line takes a Path only, a combo box a Choice."""
    takes = {"ctkPathLineEdit": "Path", "QComboBox": "Choice", "QSpinBox": "int", "qMRMLNodeComboBox": "slicer.vtkMRML"}
    node = next(n for n in ast.parse(SOURCE).body if isinstance(n, ast.ClassDef) and n.name.endswith("ParameterNode"))
    types = {e.target.id: ast.unparse(e.annotation) for e in node.body if isinstance(e, ast.AnnAssign)}
    for widget in UI.iter("widget"):
        for each in widget.findall("property"):
            if each.get("name") == "SlicerParameterName":
                assert takes[widget.get("class")] in types[each.findtext("string")], each.findtext("string")


def test_every_control_says_what_it_does() -> None:
    for widget in UI.iter("widget"):
        if widget.get("class") in ("QPushButton", "ctkPathLineEdit", "QComboBox", "QSpinBox", "qMRMLNodeComboBox"):
            tips = [p.findtext("string") for p in widget.findall("property") if p.get("name") == "toolTip"]
            assert tips and tips[0], widget.get("name")


def test_nothing_heavy_is_imported_at_file_scope() -> None:
    allowed = {"qt", "slicer", "PalpateStiffnessLib", "errors", *sys.stdlib_module_names}
    for path in [MODULE / "PalpateStiffness.py", *(MODULE / "PalpateStiffnessLib").glob("*.py")]:
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module else []
            for name in names:
                root = name.split(".")[0]
                assert root in allowed or root == "SampleData", f"{path.name} imports {name}"


def test_cmake_installs_every_file() -> None:
    listed = (MODULE / "CMakeLists.txt").read_text().replace("${MODULE_NAME}", "PalpateStiffness")
    for path in [*(MODULE / "PalpateStiffnessLib").glob("*.py"), *(MODULE / "Resources").rglob("*.*")]:
        assert path.relative_to(MODULE).as_posix() in listed, path.name


def test_the_index_entry() -> None:
    entry = json.loads((PLUGIN / "PalpateStiffness.json").read_text())
    assert {"$schema", "category", "scm_url"} <= set(entry) and entry["tier"] in range(1, 6)
    assert "project(PalpateStiffness)" in (PLUGIN / "CMakeLists.txt").read_text()
    assert f'"{entry["category"]}"' in SOURCE


def test_icon_and_screenshot() -> None:
    icon = (PLUGIN / "PalpateStiffness.png").read_bytes()
    assert struct.unpack(">II", icon[16:24]) == (128, 128)
    assert (MODULE / "Resources" / "Icons" / "PalpateStiffness.png").read_bytes() == icon
    assert (PLUGIN / "Screenshots" / "PalpateStiffness.png").stat().st_size > 50_000


def test_the_sample_pair_is_that_of_the_repository(tmp_path: Path) -> None:
    assert sample_pair() == (ROOT / "sample_dicom" / "rest", ROOT / "sample_dicom" / "deformed")
    with pytest.raises(InputError, match="clone the repository"):
        sample_pair(tmp_path)
