"""The panel's own code, with stand-ins for what only Slicer's application has: Qt, the widget's base class, the .ui loader."""

from __future__ import annotations

import importlib.util
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

slicer = pytest.importorskip("slicer", reason="slicer-core is absent: pip install slicer-core")
ROOT = Path(__file__).resolve().parents[2]
MODULE = ROOT / "plugin" / "PalpateStiffness"
sys.path[:0] = [str(MODULE), str(ROOT / "tests" / "fixtures")]

from dicom_cases import pair  # noqa: E402
from PalpateStiffnessLib import install, program  # noqa: E402
from PalpateStiffnessLib.errors import InputError  # noqa: E402
from PalpateStiffnessLib.pipeline import Pipeline, Step  # noqa: E402
from phantoms import affine  # noqa: E402

from palpate.case.labels_on_scan import labels_on_scan  # noqa: E402
from palpate.imaging.contours.user_labels import read_user_labels  # noqa: E402


class Control:
    """A widget: any attribute, and signals that are kept."""

    def __init__(self) -> None:
        self.toolTip, self.enabled, self.text, self.plainText, self.value = "tip", True, "", "", 0
        self.slots: list[Callable[..., None]] = []

    def connect(self, _signal: str, slot: Callable[..., None]) -> None:
        self.slots.append(slot)

    def appendPlainText(self, line: str) -> None:
        self.plainText += line + "\n"

    def click(self) -> None:
        assert self.enabled
        self.slots[0](False)


class Timer:
    def __init__(self) -> None:
        self.running, self.slot = False, None

    def setInterval(self, _ms: int) -> None: ...

    def connect(self, _signal: str, slot: Callable[[], None]) -> None:
        self.slot = slot

    def start(self) -> None:
        self.running = True

    def stop(self) -> None:
        self.running = False


class Controls(dict):
    def __getattr__(self, name: str) -> Control:
        return self.setdefault(name, Control())


class Loaded:
    """The widget of the .ui file, and the layout that it is added to."""

    def setMRMLScene(self, _scene: Any) -> None: ...

    def addWidget(self, _widget: Any) -> None: ...


class Base:
    def __init__(self, parent: Any = None) -> None:
        self.parent, self.layout = parent, Loaded()

    def setup(self) -> None: ...

    def resourcePath(self, name: str) -> str:
        return str(MODULE / "Resources" / name)

    def getParameterNode(self) -> dict[str, Any]:
        return {}


class Parameters:
    def __init__(self, _node: Any) -> None:
        self.restFolder = self.deformedFolder = self.caseFolder = self.program = Path()
        self.restVolume = self.deformedVolume = self.restContours = self.deformedContours = None
        self.clicks, self.method, self.tetrahedra = None, "swarm", 7000

    def connectGui(self, _ui: Any) -> int:
        return 0

    def disconnectGui(self, _tag: int) -> None: ...


class Observing:
    def addObserver(self, *_: Any) -> None: ...

    def removeObservers(self) -> None: ...


@pytest.fixture
def panel(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """The panel, set up."""

    def stand_in(name: str, **members: Any) -> types.ModuleType:
        module = types.ModuleType(name)
        module.__dict__.update(members)
        monkeypatch.setitem(sys.modules, name, module)
        return module

    stand_in("qt", QTimer=Timer, QDesktopServices=None, QUrl=None)
    stand_in("slicer.i18n", tr=lambda text: text, translate=lambda _context, text: text)
    stand_in(
        "slicer.parameterNodeWrapper",
        Choice=list,
        WithinRange=lambda *_: None,
        parameterNodeWrapper=lambda c: Parameters,
    )
    names = ("", "Logic", "Test", "Widget")
    stand_in("slicer.ScriptedLoadableModule", **{f"ScriptedLoadableModule{n}": type(n, (Base,), {}) for n in names})
    monkeypatch.setattr(slicer, "mrmlScene", slicer.vtkMRMLScene(), raising=False)
    shown: dict[str, Any] = {}
    for name, made in (
        ("VTKObservationMixin", Observing), ("loadUI", lambda _path: Loaded()), ("childWidgetVariables", lambda _w: Controls()),
        ("confirmYesNoDisplay", lambda question: shown.setdefault("asked", []).append(question) or shown.get("answer", False)),
        ("setSliceViewerLayers", lambda **layers: shown.update(layers)), ("resetSliceViews", lambda: None),
    ):  # fmt: skip
        monkeypatch.setattr(slicer.util, name, made, raising=False)
    monkeypatch.setenv("PALPATE", str(Path(sys.executable).with_name("palpate")))
    spec = importlib.util.spec_from_file_location("PalpateStiffness", MODULE / "PalpateStiffness.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    widget = module.PalpateStiffnessWidget()
    widget.setup()
    widget.shown = shown
    yield widget
    widget.cleanup()


def run_to_the_end(panel: Any) -> None:
    while panel.timer.running:
        panel.timer.slot()


def test_buttons_are_off_while_something_runs_and_say_why(panel: Any, tmp_path: Path) -> None:
    case = pair(tmp_path / "case", affine(), deformed=False)
    panel._parameters.caseFolder = case.path
    assert not panel.ui.cancelButton.enabled and panel.ui.cancelButton.toolTip == "Nothing is running"
    panel.ui.showButton.click()
    assert not panel.ui.showButton.enabled and "wait or cancel" in panel.ui.showButton.toolTip
    assert panel.ui.cancelButton.enabled
    run_to_the_end(panel)
    assert panel.ui.showButton.enabled and panel.ui.showButton.toolTip == "tip" and panel.ui.progressBar.value == 100
    assert panel.shown["background"].GetName() == "CT rest" and panel.shown["foregroundOpacity"] == 0.5
    # A second time: the earlier nodes go, the new ones stay.
    panel.ui.showButton.click()
    run_to_the_end(panel)
    assert slicer.mrmlScene.GetNodesByClass("vtkMRMLSegmentationNode").GetNumberOfItems() == 1


def test_what_is_missing_is_said_in_red_without_a_pop_up(panel: Any, tmp_path: Path) -> None:
    panel.ui.segmentButton.click()
    assert (
        panel.ui.statusLabel.text == "Choose a folder for the case first."
        and "b00020" in panel.ui.statusLabel.styleSheet
    )
    panel._parameters.caseFolder = tmp_path
    panel.ui.identifyButton.click()
    assert "is no case" in panel.ui.statusLabel.text
    panel.ui.loadButton.click()
    assert "Choose the folder of the scan at rest" in panel.ui.statusLabel.text
    panel._parameters.restFolder = panel._parameters.deformedFolder = tmp_path
    panel._parameters.program = tmp_path / "nothing"
    panel.ui.loadButton.click()
    assert "no program that can be run" in panel.ui.statusLabel.text


def test_a_failure_is_one_line_and_the_panel_goes_on(panel: Any, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    panel._parameters.restFolder = panel._parameters.deformedFolder = tmp_path / "empty"
    panel._parameters.caseFolder = tmp_path / "case"
    panel.ui.loadButton.click()
    run_to_the_end(panel)
    assert "is empty" in panel.ui.statusLabel.text and "\n" not in panel.ui.statusLabel.text
    assert panel.ui.loadButton.enabled


def test_cancel_stops(panel: Any, tmp_path: Path) -> None:
    case = pair(tmp_path / "case", affine(), deformed=False)
    panel._parameters.caseFolder = case.path
    panel.ui.reportButton.click()
    panel.timer.slot()
    panel.ui.cancelButton.click()
    assert not panel.timer.running and "cancelled" in panel.ui.statusLabel.text and panel.ui.reportButton.enabled


def test_a_step_that_ends_in_another_module_shows_its_results(panel: Any, tmp_path: Path) -> None:
    """A person changes the module while a step runs; a timer may ring once more after its end."""
    panel._parameters.caseFolder = pair(tmp_path / "case", affine(), deformed=False).path
    panel.ui.showButton.click()
    panel.exit()
    run_to_the_end(panel)
    panel.timer.slot()
    assert panel.shown["background"].GetName() == "CT rest" and panel.ui.showButton.enabled
    panel.enter()
    assert panel._connections is not None and panel._parameters.caseFolder == tmp_path / "case"


def test_the_sample_pair_fills_in_the_folders(panel: Any) -> None:
    panel.on_sample()
    assert panel._parameters.restFolder == ROOT / "sample_dicom" / "rest"
    assert "simulated" in panel.ui.statusLabel.text


def test_the_log_has_every_command_and_what_it_printed(panel: Any, tmp_path: Path) -> None:
    panel._parameters.caseFolder = pair(tmp_path / "case", affine(), deformed=False).path
    panel.ui.showButton.click()
    run_to_the_end(panel)
    lines = panel.ui.logText.plainText.splitlines()
    assert lines[0].startswith("> ") and "export" in lines[0] and "--to nrrd" in lines[0]
    assert any("export" in line and "%" in line for line in lines[1:]), "progress is in the log too"
    assert len(lines) == len(set(lines)), "nothing twice"


def test_diagnose_runs_on_the_case_and_its_verdict_is_said(
    panel: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    panel._parameters.caseFolder = pair(tmp_path / "case", affine(), deformed=False).path
    answer = {
        "verdict": "ambiguous",
        "candidates": ["wall_slid", "gravity"],
        "next_measurement": "a scan in prone position",
    }
    step = Step("diagnose", [sys.executable, "-c", f"import json; print(json.dumps({answer!r}))"])
    asked = panel.logic.stiffness().diagnose(panel._parameters.caseFolder).steps[0].command
    assert asked[-2:] == ["diagnose", str(panel._parameters.caseFolder)]
    monkeypatch.setattr(type(panel.logic.stiffness()), "diagnose", lambda self, case: Pipeline([step]))
    panel.ui.diagnoseButton.click()
    run_to_the_end(panel)
    assert "by one of: wall slid, gravity" in panel.ui.summaryText.plainText
    assert "What would settle it: a scan in prone position" in panel.ui.summaryText.plainText


def test_corrected_segments_go_back_into_a_new_case(panel: Any, tmp_path: Path) -> None:
    case = pair(tmp_path / "case", affine())
    panel._parameters.caseFolder = case.path
    panel.ui.correctButton.click()
    assert "press Show in the scene first" in panel.ui.statusLabel.text
    panel.ui.showButton.click()
    run_to_the_end(panel)
    logic = panel.logic.stiffness()
    pipeline, new = logic.corrected(case.path, panel._nodes)
    assert new == tmp_path / "case_corrected_1" and [step.name for step in pipeline.steps] == ["import", "segment"]
    command = pipeline.steps[0].command
    assert [str(case.file("rest_ct")), str(case.file("deformed_ct")), "-o", str(new)] == command[-8:-4]
    files = {command[k - 1]: Path(command[k]) for k in (-3, -1)}
    for state in ("rest", "deformed"):
        written = read_user_labels(files[f"--{state}-labels"], case.ct(state), placed=False).volume.array
        for value in (1, 2, 5):
            assert (written == value).sum() == (labels_on_scan(case, state).array == value).sum()


def test_a_missing_program_is_installed_after_asking_only(
    panel: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lacking(_given: str = "") -> list[str]:
        raise program.ProgramNotFoundError(program.INSTALL)

    panel._parameters.caseFolder = pair(tmp_path / "case", affine(), deformed=False).path
    monkeypatch.setattr("PalpateStiffnessLib.logic.program_command", lacking)
    monkeypatch.setattr(install, "target_folder", lambda: tmp_path / "own")
    panel.ui.segmentButton.click()
    assert "3.2 GB" in panel.shown["asked"][0] and str(tmp_path / "own") in panel.shown["asked"][0]
    assert panel.ui.statusLabel.text == "Nothing was installed." and panel._pipeline is None
    panel.shown["answer"] = True
    done = Pipeline([Step("environment", [sys.executable, "-c", "print('made')"], json=False)])
    monkeypatch.setattr(install, "install_pipeline", lambda python, source, target: done)
    panel.ui.installButton.click()
    run_to_the_end(panel)
    assert panel._parameters.program == install.program_in(tmp_path / "own") and "made" in panel.ui.logText.plainText


def test_the_program_gets_an_environment_with_locked_packages(tmp_path: Path) -> None:
    steps = install.install_pipeline("python3", install.source_folder(), tmp_path).steps
    assert [step.name for step in steps] == ["environment", "packages", "program"] and not any(
        step.json for step in steps
    )
    assert steps[0].command == ["python3", "-m", "venv", "--clear", str(tmp_path)]
    assert "--require-hashes" in steps[1].command and steps[1].command[-1] == str(ROOT / "requirements.lock")
    assert steps[2].command[-2:] == ["--no-deps", str(ROOT)] and Path(install.find_python()).exists()


def test_a_volume_of_the_scene_stands_for_its_folder(
    panel: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = pair(tmp_path / "case", affine(), deformed=False)
    files = sorted(case.file("rest_ct").iterdir())
    database = types.SimpleNamespace(fileForInstance=lambda uid: str(files[int(uid)]) if int(uid) < len(files) else "")
    monkeypatch.setattr(slicer, "dicomDatabase", database, raising=False)
    volume = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "CT")
    logic = panel.logic.stiffness()
    with pytest.raises(InputError, match="was not loaded by the DICOM module"):
        logic.scan_folder(Path(), volume)
    volume.SetAttribute("DICOM.instanceUIDs", " ".join(map(str, range(len(files)))))
    folder = logic.scan_folder(Path(), volume)
    assert sorted(p.read_bytes() for p in folder.iterdir()) == sorted(p.read_bytes() for p in files)
    assert logic.scan_folder(tmp_path, volume) == tmp_path, "a chosen folder goes before the volume"
    volume.SetAttribute("DICOM.instanceUIDs", "0 9999")
    with pytest.raises(InputError, match="no longer in Slicer's DICOM database"):
        logic.scan_folder(Path(), volume)
