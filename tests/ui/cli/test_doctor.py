"""What the doctor finds, and what it says when something is missing."""

from __future__ import annotations

import builtins
import json
from importlib import metadata
from typing import Any

import pytest

from palpate.core.errors import InputError
from palpate.ui import doctor, system_libraries
from palpate.ui.cli import main as cli
from palpate.ui.desktop.window import display_server
from palpate.ui.pictures import offscreen


def test_this_machine_passes(capfd: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["doctor", "--json", "--quiet"]) == 0
    checks = {check["name"]: check for check in json.loads(capfd.readouterr().out)["checks"]}
    wanted = {"python", "packages", "PARDISO", "off-screen rendering", "window", "temporary folder", "cores", "memory"}
    assert wanted | {"window's libraries"} == set(checks)
    assert "numpy" in checks["packages"]["found"]
    assert all(check["works"] for check in checks.values() if check["needed"])


def test_an_absent_package_is_3_and_named(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    known = metadata.version

    def version(name: str) -> str:
        if name == "nibabel":
            raise metadata.PackageNotFoundError(name)
        return known(name)

    monkeypatch.setattr(metadata, "version", version)
    monkeypatch.setattr(doctor, "examine", lambda progress: [doctor._packages()])
    assert cli.main(["doctor", "--quiet"]) == 3
    assert "packages: absent: nibabel; remove .venv and run ./run again" in capfd.readouterr().err


def test_without_pardiso_it_still_works_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = builtins.__import__

    def no_pardiso(name: str, *rest: Any, **more: Any) -> Any:
        if name == "pypardiso":
            raise ImportError("no MKL here")
        return usual(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", no_pardiso)
    check = doctor._solver()
    assert not check.works and not check.needed
    assert "no MKL here; SuperLU is used" in check.found


def test_without_rendering_the_remedy_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise offscreen.OffscreenError("off-screen rendering ended with status -11")

    monkeypatch.setattr(offscreen, "check", fail)
    check = doctor._rendering()
    assert not check.works and not check.needed
    assert check.remedy == "apt-get install libegl1 libgl1-mesa-dri"


def test_what_the_window_lacks_is_told_with_the_line_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    there = {"libEGL.so.1", "libGL.so.1"}
    named = system_libraries.missing(lambda name: name in there)
    assert "libxcb-cursor0" in named and "libegl1" not in named and list(named) == sorted(named)
    monkeypatch.setattr(system_libraries, "missing", lambda: ("libdbus-1-3", "libxcb-cursor0"))
    check = doctor._libraries()
    assert not check.works and not check.needed
    assert check.remedy == "apt-get install libdbus-1-3 libxcb-cursor0"
    with pytest.raises(InputError, match="on Debian: apt-get install libdbus-1-3 libxcb-cursor0"):
        display_server.check(headless=False)


def test_without_a_display_only_the_window_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    check = doctor._window()
    assert not check.works and not check.needed
    assert "there is no display" in check.found and "--headless" in check.remedy
