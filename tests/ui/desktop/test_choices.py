"""Several series in a folder, and structures whose names tell nothing: the real window asks, and the case is made of the answer."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pydicom
import pytest
from desktop_pair import write_pair
from x_display import needs_xvfb, x_display

from palpate.case.case_folder import CaseFolder
from palpate.imaging.contours.seg_nrrd import write_seg_nrrd
from palpate.imaging.contours.structure_list import is_clear, list_structures
from palpate.imaging.dicom.series import read_series
from palpate.imaging.dicom.series_list import list_series
from palpate.simulate.phantom import phantom

ASKED = """
import json, sys
from pathlib import Path
from palpate.ui.desktop.qt_application import events_for
from palpate.ui.desktop.window.application import new_window

window, application = new_window(headless=False)
window.show()
process = events_for(application)
controller = window.controller
rest, deformed, labels, case, folder = (Path(text) for text in sys.argv[1:])
window.page.pair.rest, window.page.pair.deformed, window.page.pair.case = rest, deformed, case
window.page.pair.rest_labels = labels
told = {}

def until(done, seconds=300.0):
    for _ in range(int(seconds / 0.05)):
        if done():
            return
        process(0.05)
    raise SystemExit("it did not come to its end: " + controller.said)

def asked():
    return getattr(window, "choice", None)

def answered(accept):
    page = window.choice
    page.accept() if accept else page.reject()
    del window.choice
    process(0.1)

window.page.open_pair()
until(asked)
answered(False)
told["given up"] = [controller.said, controller.case is None, case.exists()]
window.page.open_pair()
until(asked)
page = window.choice
process(0.2)
page.grab().save(str(folder / "choice.png"))
listed, table = page.series["rest"], page.structures["rest"]
told["series"] = [listed.item(k).text() for k in range(listed.count())]
told["pictures"] = [not listed.item(k).icon().isNull() for k in range(listed.count())]
told["structures"] = [[table.item(k, 0).text(), float(table.item(k, 1).text()), table.choices[k].currentText()]
                      for k in range(table.rowCount())]
ok = page._buttons.button(page._buttons.StandardButton.Ok)
told["ok"] = [ok.isEnabled()]
listed.setCurrentRow([k for k in range(listed.count()) if "every 4 mm" in listed.item(k).text()][0])
told["ok"].append(ok.isEnabled())
table.choices[[k for k in range(table.rowCount()) if table.item(k, 0).text() == "Struktur 1"][0]].setCurrentText("prostate")
told["ok"].append(ok.isEnabled())
answered(True)
until(lambda: controller.case is not None and not controller.jobs.running and not controller.reader.running)
told["case"] = [str(controller.case.folder.path), controller.said]
window.hide(); window.shut()
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Path]:
    """A folder with two series of the patient at rest, one deformed scan, and a label file with names that tell nothing."""
    folder = tmp_path_factory.mktemp("choices")
    rest, deformed = write_pair(folder)
    both = folder / "two"
    shutil.copytree(rest, both / "a")
    (both / "b").mkdir()
    for path in sorted(rest.glob("*.dcm"))[::2]:  # every second slice: another series of 8 mm
        dataset = pydicom.dcmread(path)
        dataset.SeriesInstanceUID += ".1"
        dataset.SOPInstanceUID += ".1"
        dataset.file_meta.MediaStorageSOPInstanceUID = dataset.SOPInstanceUID
        dataset.SliceThickness = "8"
        dataset.save_as(both / "b" / path.name)
    return both, deformed, _labels(folder, rest)


def _labels(folder: Path, rest: Path) -> Path:
    volume, _ = read_series(rest)
    index = np.indices(volume.array.shape).reshape(3, -1).T.astype(float)
    away = np.linalg.norm(volume.to_lps(index) - phantom.prostate_centroid(), axis=1).reshape(volume.array.shape)
    array = np.zeros(volume.array.shape, dtype=np.uint8)
    array[away < 18.0] = 1
    array[(away > 40.0) & (away < 45.0)] = 2
    path = folder / "labels.seg.nrrd"
    write_seg_nrrd(path, volume.with_array(array), {1: "Struktur 1", 2: "Struktur 2"})
    return path


def test_series_are_listed_with_what_tells_them_apart(scans: tuple[Path, Path, Path]) -> None:
    entries = list_series(scans[0])
    assert sorted((entry.slices, entry.thickness_mm) for entry in entries) == [(19, 8.0), (38, 4.0)]
    for entry in entries:
        volume, _ = read_series(scans[0], entry.identifier)
        assert volume.array.shape[2] == entry.slices
        assert entry.picture is not None and max(entry.picture.shape) <= 128 and "Doe" not in entry.description


def test_structures_are_listed_with_their_volume(scans: tuple[Path, Path, Path]) -> None:
    entries = {entry.name: entry for entry in list_structures(scans[2])}
    assert set(entries) == {"Struktur 1", "Struktur 2"}
    assert entries["Struktur 1"].volume_cc == pytest.approx(4.0 / 3.0 * np.pi * 1.8**3, rel=0.05)
    assert not is_clear(list(entries.values()), scans[2])


@needs_xvfb
def test_the_window_asks_and_makes_the_case_of_the_answer(scans: tuple[Path, Path, Path], tmp_path: Path) -> None:
    case = tmp_path / "case"
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("PALPATE_SETTINGS", str(tmp_path / "settings"))
        with x_display(tmp_path, "1280x720", monkeypatch):
            command = [sys.executable, "-c", ASKED, *(str(path) for path in (*scans, case, tmp_path))]
            done = subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)
    if "no window can be opened" in done.stderr:
        pytest.skip("Qt's X11 libraries are not on this machine")
    assert done.returncode == 0, done.stderr[-3000:]
    told = json.loads(done.stdout.splitlines()[-1])
    said, none, made = told["given up"]
    assert "nothing was chosen" in said and none and not made
    assert len(told["series"]) == 2 and all(told["pictures"]) and any("19 slices" in words for words in told["series"])
    assert sorted(row[0] for row in told["structures"]) == ["Struktur 1", "Struktur 2"]
    assert {row[2] for row in told["structures"]} == {"not used"}
    assert told["ok"] == [False, False, True], "both must be chosen"
    found = CaseFolder(case)
    assert len(list(found.file("rest_ct").glob("*.dcm"))) == 38
    assert found.read_json("user_labels.json")["rest"]["structures"] == {"prostate": ["Struktur 1"]}
