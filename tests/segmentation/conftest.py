"""Third-party data for the tests of this room: unpacked once per session, skipped with a reason where it is absent."""

from __future__ import annotations

import tarfile
from collections.abc import Iterator
from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2].parent / "shared" / "data"


def _unpacked(name: str, factory: pytest.TempPathFactory) -> Path:
    archive = SHARED / name
    if not archive.is_file():
        pytest.skip(f"{archive} is absent: third-party data, see its README")
    folder = factory.mktemp(name.split(".")[0])
    with tarfile.open(archive) as tar:
        tar.extractall(folder, filter="data")
    return folder


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
