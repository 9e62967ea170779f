"""Third-party data, unpacked once a session; and what tests have to show beside passing, printed after them."""

from __future__ import annotations

import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

SHARED = Path(__file__).resolve().parents[1].parent / "shared" / "data"

# Files whose tests take longest, in falling order of seconds as measured with two processes. `./run test` hands out whole files:
# these are begun first, so that no process is left alone at the end with a long one.
LONGEST = (
    "tests/ui/desktop/test_desktop_xvfb.py",
    "tests/core/diagnose/test_joint_states.py",
    "tests/core/diagnose/test_bench_patches.py",
    "tests/plugin/test_plugin_logic.py",
    "tests/segmentation/test_organs_step.py",
    "tests/ui/export/test_contours_round_trip.py",
    "tests/ui/desktop/test_desktop_window.py",
    "tests/case/test_rigid_offset.py",
    "tests/core/diagnose/test_diagnose.py",
    "tests/segmentation/test_organs_pointed.py",
    "tests/core/identify/test_identify_image.py",
    "tests/ui/desktop/test_desktop_step_job.py",
    "tests/ui/cli/test_killed_anywhere.py",
    "tests/case/test_surface_pair.py",
    "tests/imaging/test_two_scans.py",
    "tests/ui/desktop/test_organ_jobs.py",
    "tests/benchmarks/test_bench.py",
    "tests/simulate/test_hidden_effects.py",
    "tests/core/identify/test_identify.py",
    "tests/case/test_mesh_step.py",
    "tests/segmentation/test_bladder_core.py",
    "tests/segmentation/test_organs_phantom.py",
    "tests/ui/export/test_dicom_export.py",
    "tests/imaging/test_local_matching.py",
    "tests/core/residual/test_kept_fit.py",
    "tests/ui/desktop/test_desktop_logic.py",
    "tests/ui/desktop/test_screen_sizes.py",
    "tests/applications/test_sketch.py",
    "tests/applications/test_touch_window.py",
    "tests/core/diagnose/test_bench_bodies.py",
    "tests/core/identify/test_several_states.py",
    "tests/case/test_deformed_states.py",
    "tests/python/test_from_python.py",
    "tests/case/test_plan.py",
    "tests/validate/test_paper_figures.py",
    "tests/meshing/test_label_surfaces.py",
    "tests/validate/test_paper_tables.py",
    "tests/plugin/test_plugin_panel.py",
    "tests/repository/test_examples.py",
    "tests/ui/cli/test_pages_run.py",
)

TABLE = pytest.StashKey[list[str]]()
_SENT = "table"


@pytest.fixture(scope="session")
def shown(pytestconfig: pytest.Config) -> list[str]:
    """Lines to print at the end."""
    return pytestconfig.stash.setdefault(TABLE, [])


def pytest_configure() -> None:
    """Ends at once where `palpate` is another checkout's: its tests would pass or fail for what is not in this tree."""
    import palpate.core

    tree, found = Path(__file__).resolve().parents[1], Path(palpate.core.__file__ or "").resolve()
    if not found.is_relative_to(tree):
        pytest.exit(f"palpate.core is {found}, not of {tree}: run `./run setup` here, and its .venv's python", 4)


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--nightly` : the tests marked `nightly` too."""
    parser.addoption("--nightly", action="store_true", help="also what takes minutes and changes seldom")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The longest files first; all else in the order in which it was found. Nightly tests only where they are asked for."""
    late = [] if config.getoption("--nightly") else [one for one in items if one.get_closest_marker("nightly")]
    if late:
        config.hook.pytest_deselected(items=late)
        items[:] = [one for one in items if not one.get_closest_marker("nightly")]
    place = {name: k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.nodeid.partition("::")[0], len(place)))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """A process of several hands its lines over."""
    output = getattr(session.config, "workeroutput", None)
    if output is not None:
        output[_SENT] = session.config.stash.get(TABLE, [])


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Takes the lines of a process that has ended."""
    node.config.stash.setdefault(TABLE, []).extend(getattr(node, "workeroutput", {}).get(_SENT, []))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Prints the table of the hostile DICOM folders."""
    lines = config.stash.get(TABLE, [])
    if lines:
        terminalreporter.section("hostile DICOM folders")
        for line in lines:
            terminalreporter.write_line(line)


def _unpacked(name: str, factory: pytest.TempPathFactory) -> Path:
    archive = SHARED / name
    if not archive.is_file():
        pytest.skip(f"{archive} is absent: third-party data, see its README")
    folder = factory.mktemp(name.split(".")[0])
    with tarfile.open(archive) as tar:
        tar.extractall(folder, filter="data")
    return folder


@pytest.fixture(scope="session")
def wild(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    yield _unpacked("wild.tar.xz", tmp_path_factory) / "wild_dev"


@pytest.fixture(scope="session")
def wild2(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    yield _unpacked("wild2.tar.xz", tmp_path_factory) / "wild2"


@pytest.fixture(scope="session")
def hostile_dicom(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    yield _unpacked("hostile_dicom.tar.xz", tmp_path_factory)


@pytest.fixture(scope="session")
def pelvis_small(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Folder with CT/ and RTstructs.dcm."""
    yield next(_unpacked("pelvis_ct_small.tar.xz", tmp_path_factory).rglob("RTstructs.dcm")).parent


@pytest.fixture(scope="session")
def pelvis_005(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Folder with CT*.dcm and one RS*.dcm."""
    yield next(_unpacked("pelvis_ct_005.tar.xz", tmp_path_factory).rglob("RS*.dcm")).parent
