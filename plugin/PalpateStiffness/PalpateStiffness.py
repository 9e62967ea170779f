"""3D Slicer module: stiffness of an organ from two CT scans. Thin: the palpate program works in a child process."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import qt
import slicer
from PalpateStiffnessLib import install
from PalpateStiffnessLib.errors import InputError
from PalpateStiffnessLib.logic import METHODS, StiffnessLogic
from PalpateStiffnessLib.nodes import LoadError, ResultNodes
from PalpateStiffnessLib.pipeline import DONE, FAILED, RUNNING, Pipeline
from PalpateStiffnessLib.program import ProgramNotFoundError
from PalpateStiffnessLib.sample import sample_pair
from PalpateStiffnessLib.words import RESEARCH_USE, summary
from slicer.i18n import tr as _
from slicer.i18n import translate
from slicer.parameterNodeWrapper import Choice, WithinRange, parameterNodeWrapper
from slicer.ScriptedLoadableModule import (
    ScriptedLoadableModule,
    ScriptedLoadableModuleLogic,
    ScriptedLoadableModuleTest,
    ScriptedLoadableModuleWidget,
)
from slicer.util import VTKObservationMixin

POLL_MS = 200
_BUTTONS = (
    "loadButton", "segmentButton", "identifyButton", "diagnoseButton", "reportButton", "showButton", "correctButton", "installButton",
)  # fmt: skip


class PalpateStiffness(ScriptedLoadableModule):
    """What Slicer lists."""

    def __init__(self, parent):
        ScriptedLoadableModule.__init__(self, parent)
        parent.title = _("Palpate Stiffness")
        parent.categories = [translate("qSlicerAbstractCoreModule", "Quantification")]
        parent.dependencies = []
        parent.contributors = ["The Palpate authors"]
        parent.helpText = _(
            "Finds the stiffness of the prostate from two CT scans, one at rest and one in which the organ is deformed, and "
            "says how sure it is. Research use only, not for diagnosis. See the tutorial in the extension's folder."
        )
        parent.acknowledgementText = _("Method: MaterialCloning. Apache-2.0.")
        slicer.app.connect("startupCompleted()", register_sample_data)


def register_sample_data():
    """The simulated pair of the repository as a case of the Sample Data module: it fills in the panel's two folders."""
    import SampleData

    SampleData.SampleDataLogic.registerCustomSampleDataSource(
        category="Palpate",
        sampleName="PalpatePair",
        thumbnailFileName=str(Path(__file__).parent / "Resources" / "Icons" / "PalpateStiffness.png"),
        loadFileType=None,
        customDownloader=open_with_sample,
    )


def open_with_sample(_source):
    """Opens the module, which makes its panel where there is none yet, and fills in the folders."""
    slicer.util.selectModule("PalpateStiffness")
    slicer.modules.PalpateStiffnessWidget.on_sample()
    return []


@parameterNodeWrapper
class PalpateStiffnessParameterNode:
    """What a scene remembers of the panel.

    restFolder, deformedFolder : DICOM; where empty, the volumes of the scene. restContours, deformedContours : segmentations of the
    scene. caseFolder : where everything is kept. program : path of the palpate program, found where empty. clicks : points named by
    organ, in the scan at rest. method, tetrahedra : of the search.
    """

    restFolder: Path
    deformedFolder: Path
    restVolume: slicer.vtkMRMLScalarVolumeNode
    deformedVolume: slicer.vtkMRMLScalarVolumeNode
    restContours: slicer.vtkMRMLSegmentationNode
    deformedContours: slicer.vtkMRMLSegmentationNode
    caseFolder: Path
    program: Path
    clicks: slicer.vtkMRMLMarkupsFiducialNode
    method: Annotated[str, Choice(list(METHODS))] = METHODS[0]
    tetrahedra: Annotated[int, WithinRange(500, 100000)] = 7000


class PalpateStiffnessWidget(ScriptedLoadableModuleWidget, VTKObservationMixin):
    """The panel: starts pipelines, asks by a timer how far they are, shows what they wrote."""

    def __init__(self, parent=None):
        ScriptedLoadableModuleWidget.__init__(self, parent)
        VTKObservationMixin.__init__(self)
        self.logic = None
        self._pipeline: Pipeline | None = None
        self._then = None
        self._nodes: ResultNodes | None = None
        self._results = {}
        self._logged = 0
        self._parameters = None
        self._connections = None

    def setup(self):
        """Builds the panel from its .ui file."""
        ScriptedLoadableModuleWidget.setup(self)
        widget = slicer.util.loadUI(self.resourcePath("UI/PalpateStiffness.ui"))
        self.layout.addWidget(widget)
        self.ui = slicer.util.childWidgetVariables(widget)
        widget.setMRMLScene(slicer.mrmlScene)
        self.logic = PalpateStiffnessLogic()
        self.timer = qt.QTimer()
        self.timer.setInterval(POLL_MS)
        self.timer.connect("timeout()", self.on_timer)
        self.ui.researchLabel.text = RESEARCH_USE
        for button, slot in (
            (self.ui.loadButton, self.on_load),
            (self.ui.segmentButton, self.on_segment),
            (self.ui.identifyButton, self.on_identify),
            (self.ui.diagnoseButton, self.on_diagnose),
            (self.ui.correctButton, self.on_correct),
            (self.ui.installButton, self.on_install),
            (self.ui.reportButton, self.on_report),
            (self.ui.showButton, self.on_show),
            (self.ui.cancelButton, self.on_cancel),
        ):
            button.connect("clicked(bool)", lambda _checked, slot=slot: self._guarded(slot))
        self.addObserver(slicer.mrmlScene, slicer.mrmlScene.StartCloseEvent, self.on_scene_closes)
        self.addObserver(slicer.mrmlScene, slicer.mrmlScene.EndCloseEvent, self.on_scene_closed)
        self._connect_parameters()
        self._update_buttons()

    def cleanup(self):
        """The module is unloaded: nothing goes on."""
        self.on_cancel()
        self.removeObservers()
        if self.logic is not None:
            self.logic.clean()

    def enter(self):
        """The module is opened."""
        self._connect_parameters()

    def exit(self):
        """Another module is opened; what runs goes on, and its results are shown when it has ended."""
        self._disconnect_gui()

    def on_scene_closes(self, caller, event):
        """Results belong to the scene that is being closed."""
        self.on_cancel()
        self._disconnect_gui()
        self._parameters = None

    def on_scene_closed(self, caller, event):
        """A new scene, new parameters."""
        self._nodes, self._results = None, {}
        if self.parent.isEntered:
            self._connect_parameters()

    def on_sample(self):
        """Fills in the folders of the sample pair."""
        self._guarded(self._fill_in_sample)

    def _fill_in_sample(self):
        self._parameters.restFolder, self._parameters.deformedFolder = sample_pair()
        self.ui.statusLabel.text = _("The sample pair is simulated: choose a folder for the case, then load it.")

    def on_load(self):
        """Imports the pair."""
        p, case, logic = self._parameters, self._case(), self._stiffness()
        rest = logic.scan_folder(p.restFolder, p.restVolume)
        deformed = logic.scan_folder(p.deformedFolder, p.deformedVolume)
        labels = (logic.contours(p.restContours), logic.contours(p.deformedContours))
        self._start(logic.load_pair(rest, deformed, case, labels=labels), lambda: self._show(case))

    def on_segment(self):
        """Finds the organs."""
        case = self._case()
        self._start(self._stiffness().segment(case, self._parameters.clicks), lambda: self._show(case))

    def on_identify(self):
        """Finds the stiffness."""
        p, case = self._parameters, self._case()
        self._start(self._stiffness().identify(case, p.method, (), p.tetrahedra), lambda: self._show(case))

    def on_diagnose(self):
        """Looks for what the model leaves out."""
        self._start(self._stiffness().diagnose(self._case()), None)

    def on_correct(self):
        """The segments of the scene, as they are now, into a new case, which the panel names from then on."""
        shown = self._nodes if self._nodes is not None else ResultNodes()
        pipeline, case = self._stiffness().corrected(self._case(), shown)

        def corrected():
            self._parameters.caseFolder = case
            self._show(case)

        self._start(pipeline, corrected)

    def on_install(self):
        """Asks, then makes an environment for the program and names it in the panel."""
        source, target = install.source_folder(), install.target_folder()
        if not slicer.util.confirmYesNoDisplay(install.QUESTION.format(source=source, target=target)):
            self.ui.statusLabel.text = _("Nothing was installed.")
            return
        pipeline = install.install_pipeline(install.find_python(), source, target)

        def installed():
            self._parameters.program = install.program_in(target)
            self.ui.statusLabel.text = _("The program is installed; go on.")

        self._start(pipeline, installed)

    def on_report(self):
        """Writes the report and opens it."""
        page = self._case() / "report" / "report.html"
        pipeline = self._stiffness().report(self._case())
        self._start(pipeline, lambda: qt.QDesktopServices.openUrl(qt.QUrl.fromLocalFile(str(page))))

    def on_show(self):
        """Exports the case and shows it in the scene."""
        self._show(self._case())

    def _show(self, case):
        """The same for a case that a step was started on, whatever the panel names by now."""
        pipeline, folder = self._stiffness().export(case)

        def shown():
            self._nodes = self._stiffness().show_results(folder, self._nodes)
            self.logic.show_in_slices(self._nodes)

        self._start(pipeline, shown)

    def on_cancel(self):
        """Stops what runs; no process is left."""
        if self._pipeline is not None:
            self._pipeline.cancel()
            self.on_timer()

    def on_timer(self):
        """How far is it?"""
        pipeline = self._pipeline
        if pipeline is None:  # a last ring of a timer that has been stopped
            return
        state = pipeline.poll()
        self.ui.progressBar.value = round(100 * pipeline.fraction)
        self.ui.statusLabel.text = pipeline.message
        self._show_log(pipeline)
        if state == RUNNING:
            return
        self.timer.stop()
        self._pipeline, then, self._then = None, self._then, None
        self._results.update(pipeline.results)
        self.ui.summaryText.plainText = "\n".join(summary(self._results))
        self.ui.statusLabel.styleSheet = "color: #b00020" if state == FAILED else ""
        self._update_buttons()
        if state == DONE and then is not None:
            self._guarded(then)

    def _show_log(self, pipeline):
        """What has been printed since the last time."""
        for line in pipeline.log[self._logged :]:
            self.ui.logText.appendPlainText(line)
        self._logged = len(pipeline.log)

    def _start(self, pipeline, then):
        self._pipeline, self._then, self._logged = pipeline, then, 0
        self.ui.statusLabel.styleSheet = ""
        self.timer.start()
        self._update_buttons()

    def _guarded(self, slot):
        """Runs a slot; what a person can put right is said in the panel."""
        try:
            slot()
        except ProgramNotFoundError as error:
            self._refuse(error)
            if self._parameters.program == Path():  # nothing is chosen that a person could mean instead
                self._guarded(self.on_install)
        except (InputError, LoadError) as error:
            self._refuse(error)

    def _refuse(self, error):
        self.ui.statusLabel.text = str(error)
        self.ui.statusLabel.styleSheet = "color: #b00020"

    def _stiffness(self):
        """The logic, calling the program that the panel names; an empty path is `.` in a parameter node."""
        program = self._parameters.program
        return self.logic.stiffness("" if program == Path() else str(program))

    def _case(self):
        if self._parameters.caseFolder == Path():
            raise InputError(_("Choose a folder for the case first."))
        return self._parameters.caseFolder

    def _update_buttons(self):
        """Off while something runs; a button that is off says why."""
        running = self._pipeline is not None
        why = _("Something is running: wait or cancel.")
        for button in _BUTTONS:
            widget = getattr(self.ui, button)
            if not hasattr(self, f"_tip_{button}"):
                setattr(self, f"_tip_{button}", widget.toolTip)
            widget.enabled = not running
            widget.toolTip = why if running else getattr(self, f"_tip_{button}")
        self.ui.cancelButton.enabled = running
        self.ui.cancelButton.toolTip = (
            _("Stop and kill what runs; what is done is kept") if running else _("Nothing is running")
        )

    def _connect_parameters(self):
        if self._parameters is None:
            self._parameters = self.logic.getParameterNode()
        if self._connections is None:
            self._connections = self._parameters.connectGui(self.ui)

    def _disconnect_gui(self):
        """The parameters stay: a step that runs meanwhile needs them when it ends."""
        if self._connections is not None:
            self._parameters.disconnectGui(self._connections)
            self._connections = None


class PalpateStiffnessLogic(ScriptedLoadableModuleLogic):
    """The logic in the form that Slicer asks for; the work is in PalpateStiffnessLib, which needs no application."""

    def __init__(self):
        ScriptedLoadableModuleLogic.__init__(self)
        self._logic = StiffnessLogic(slicer.mrmlScene)

    def getParameterNode(self):
        """The typed parameter node of the scene."""
        return PalpateStiffnessParameterNode(super().getParameterNode())

    def stiffness(self, program=""):
        """The logic, calling the program at a path, or the one that is found."""
        self._logic.program = program
        return self._logic

    def clean(self):
        """Removes temporary exports."""
        self._logic.clean()

    def show_in_slices(self, nodes):
        """The scan at rest behind, the stiffness half transparent over it, the prostate in the middle."""
        rest = nodes.volumes.get("rest")
        slicer.util.setSliceViewerLayers(
            background=rest, foreground=nodes.stiffness, foregroundOpacity=0.5 if nodes.stiffness is not None else 0.0
        )
        if rest is not None:
            slicer.util.resetSliceViews()


class PalpateStiffnessTest(ScriptedLoadableModuleTest):
    """The self test: the module's panel, and the way from an exported case to nodes, without the program."""

    def setUp(self):
        """An empty scene."""
        slicer.mrmlScene.Clear()

    def runTest(self):
        """All tests."""
        self.setUp()
        self.test_panel()
        self.test_refusal()

    def test_panel(self):
        """The parameters of the scene reach the panel, and back."""
        slicer.util.selectModule("PalpateStiffness")
        widget = slicer.modules.PalpateStiffnessWidget
        widget._parameters.caseFolder = Path("/tmp/case")
        self.assertEqual(widget.ui.caseFolderEdit.currentPath, "/tmp/case")
        self.assertFalse(widget.ui.cancelButton.enabled)

    def test_refusal(self):
        """What is missing is said in the panel, without a pop-up."""
        widget = slicer.modules.PalpateStiffnessWidget
        widget._parameters.caseFolder = Path("/tmp/no-case")
        widget._guarded(widget.on_segment)
        self.assertIn("is no case", widget.ui.statusLabel.text)
