"""A wheel holds what an editable install finds by itself."""

import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
from rooms import PACKAGES, ROOMS

TOP = Path(__file__).parents[2]
# Scans, not modules.
SAMPLE = "palpate.sample_dicom"


def package_of(folder: Path) -> str:
    """The import name of a folder: the package's own face, or a room that lies beside it."""
    parts = folder.relative_to(TOP).parts
    return ".".join(parts if parts[0] == "palpate" else ("palpate", *parts))


def test_every_package_is_listed() -> None:
    listed = tomllib.loads((TOP / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    there = [package_of(init.parent) for room in PACKAGES for init in (TOP / room).rglob("__init__.py")]
    assert sorted(set(listed) - {SAMPLE}) == sorted(there)


def test_files_that_are_no_python_go_with_their_package() -> None:
    data = tomllib.loads((TOP / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    for room in PACKAGES:
        for path in (TOP / room).rglob("*.*"):
            if path.suffix == ".py" or "__pycache__" in path.parts:
                continue
            package = package_of(path.parent)
            assert any(path.match(pattern) for pattern in data.get(package, [])), path


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """A wheel of the tracked files, built as `pip wheel .` does it."""
    folder = tmp_path_factory.mktemp("wheel")
    listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    tracked = subprocess.run(listing, cwd=TOP, capture_output=True, check=False)
    if tracked.returncode != 0:
        pytest.skip("not a git checkout")
    for name in filter(None, tracked.stdout.decode().split("\0")):
        if (TOP / name).is_file() and not name.startswith(("docs/", "tests/")):
            (folder / "src" / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(TOP / name, folder / "src" / name)
    asked = ["-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--disable-pip-version-check"]
    built = subprocess.run(
        [sys.executable, *asked, "-w", str(folder), str(folder / "src")], capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stderr[-2000:]
    (path,) = folder.glob("palpate-*.whl")
    return zipfile.ZipFile(path)


def test_a_wheel_holds_every_module_the_files_beside_them_and_the_sample(wheel: zipfile.ZipFile) -> None:
    names = set(wheel.namelist())
    for room in ROOMS:
        for path in (TOP / room).rglob("*.py"):
            assert f"palpate/{path.relative_to(TOP).as_posix()}" in names, path
    assert {"palpate/__init__.py", "palpate/__init__.pyi", "palpate/py.typed", "palpate/ui/report/page.html"} <= names
    for state in ("rest", "deformed"):
        there = {f"palpate/sample_dicom/{state}/{path.name}" for path in (TOP / "sample_dicom" / state).iterdir()}
        assert there and there <= names
    assert "palpate/sample_dicom/finished_case.zip" in names
    (scripts,) = (name for name in names if name.endswith("entry_points.txt"))
    assert "palpate = palpate.ui.cli.main:entry" in wheel.read(scripts).decode()


def test_an_unpacked_wheel_runs_from_anywhere(wheel: zipfile.ZipFile, tmp_path: Path) -> None:
    """Its own modules, not those of this checkout, which an editable install would find."""
    wheel.extractall(tmp_path / "site")
    code = "import sys; sys.path.insert(0, sys.argv[1]); import palpate, palpate.ui.cli.main as main\n" \
           "import palpate.case.sample.scans as sample\n" \
           "assert palpate.__file__.startswith(sys.argv[1]), palpate.__file__\n" \
           "assert all(str(p).startswith(sys.argv[1]) for p in sample.sample_scans()); sys.exit(main.main(['demo', '--help']))"  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "site")], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and "usage: palpate demo" in done.stdout, done.stderr[-1500:]
