"""The command line: exit codes, purity of JSON, and that nothing is left running."""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from phantoms import write_case

from palpate.core.errors import ConvergenceError, InputError
from palpate.ui.cli import main as cli
from palpate.ui.cli.arguments import UsageError, no_points, points, random_seed
from palpate.ui.cli.commands import report as report_command
from palpate.ui.cli.console import Console
from palpate.ui.cli.signals import descendants

# Stands in for a command that takes long: a child that outlives its parent unless it is ended, and C code that sleeps.
SLEEPER = """
import subprocess, sys, types, time
import palpate.ui.cli.main as cli
sleeper = types.ModuleType("palpate.ui.cli.commands.sleeper")
sleeper.NAME, sleeper.HELP, sleeper.add_arguments = "sleeper", "sleeps", lambda parser: None
def run(args, console):
    with console.progress("sleeper") as progress:
        child = subprocess.Popen(["sleep", "60"])
        print("CHILD", child.pid, file=sys.stderr, flush=True)
        time.sleep(60)
sleeper.run = run
sys.modules["palpate.ui.cli.commands.sleeper"] = sleeper
cli.COMMANDS = {"sleeper": "sleeper"}
sys.exit(cli.main(["sleeper", *sys.argv[1:]]))
"""


def ends_with(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def run(args: argparse.Namespace, console: Console) -> None:
        raise error

    monkeypatch.setattr(report_command, "run", run)


@pytest.mark.parametrize(
    "given", [[], ["feel"], ["report"], ["report", "x", "--bogus"], ["identify", "x", "--particles", "2"]]
)
def test_wrong_usage_is_2_and_nothing_on_standard_output(given: list[str], capfd: pytest.CaptureFixture[str]) -> None:
    assert cli.main(given) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert err.strip().splitlines()[-1].startswith("palpate: ")


def test_wrong_usage_is_told_as_json_too(capfd: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["report", "--json"]) == 2
    told = json.loads(capfd.readouterr().out)
    assert told["exit_code"] == 2 and "CASE" in told["error"]


def test_a_missing_case_is_3_in_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["report", str(tmp_path / "none"), "--quiet"]) == 3
    out, err = capfd.readouterr()
    assert out == "" and err.count("\n") == 1
    assert err.startswith(f"palpate: {tmp_path / 'none'} is no folder; give ")


@pytest.mark.parametrize(
    "error, status, text",
    [
        (InputError("a\nb"), 3, "a b"),
        (ConvergenceError("no equilibrium"), 4, "no equilibrium"),
        (KeyboardInterrupt(), 130, "cancelled; run the same command again"),
        (PermissionError(13, "Permission denied", "/scans/out"), 3, "/scans/out: Permission denied; check the path"),
        (OSError(28, "No space left on device"), 3, "No space left on device; check disk space"),
    ],
)
def test_each_error_has_its_status_and_one_line(
    error: BaseException, status: int, text: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    ends_with(monkeypatch, error)
    assert cli.main(["report", "x", "--json"]) == status
    out, err = capfd.readouterr()
    assert json.loads(out)["exit_code"] == status
    assert err.startswith(f"palpate: {text}") and err.count("\n") == 1


def test_a_fault_of_the_program_is_not_dressed_up_as_bad_input(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    ends_with(monkeypatch, ZeroDivisionError("a bug of Miller^John"))
    assert cli.main(["report", "x"]) == 5
    _, err = capfd.readouterr()
    assert err.startswith("palpate: ZeroDivisionError in ") and err.count("\n") == 1
    assert "Miller" not in err  # an error's own text may name a patient


def test_json_is_one_object_whatever_libraries_print(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def noisy(args: argparse.Namespace, console: Console) -> tuple[dict[str, object], str]:
        os.write(1, b"PARDISO says hello\n")
        print("and so does Python", flush=True)
        with console.progress("report") as progress:
            progress(0.5, "half")
        return {"value": float("nan"), "name": "μ"}, "text for a person"

    monkeypatch.setattr(report_command, "run", noisy)
    assert cli.main(["report", "x", "--json"]) == 0
    out, err = capfd.readouterr()
    assert json.loads(out) == {"value": None, "name": "μ"} and out.count("\n") == 1
    assert "PARDISO says hello" in err and "and so does Python" in err and "report 50 %: half" in err


def test_report_command_tells_where_the_report_is(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write_case(tmp_path / "case")
    assert cli.main(["report", str(tmp_path / "case"), "--json", "--quiet"]) == 0
    out, err = capfd.readouterr()
    written = json.loads(out)
    assert err == "" and written["missing"] == []
    assert all(Path(path).is_file() for path in [written["html"], written["pdf"], *written["pictures"]])


def _hears_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_with_130_and_leaves_no_process(number: signal.Signals) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", SLEEPER, "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A shell starts background jobs with Ctrl-C ignored, and the tests may be one; the program rightly inherits that.
        preexec_fn=_hears_interrupts,
    )
    assert process.stderr is not None
    child = int(process.stderr.readline().split()[1])
    assert child in descendants(process.pid)
    process.send_signal(number)
    out, err = process.communicate(timeout=20)
    assert process.returncode == 130
    assert json.loads(out)["exit_code"] == 130
    assert err.strip().splitlines()[-1].startswith("palpate: cancelled; run the same command again")
    deadline = time.monotonic() + 5.0
    while Path(f"/proc/{child}").exists() and time.monotonic() < deadline:
        if "Z" in Path(f"/proc/{child}/stat").read_text().rpartition(")")[2]:
            break
        time.sleep(0.05)
    else:
        assert not Path(f"/proc/{child}").exists()


def seeds(*texts: str) -> argparse.Namespace:
    return cli.arguments(["report", "x", *(f"--seed={text}" for text in texts)])


def test_seed_is_a_number_or_a_point() -> None:
    args = seeds("5", "prostate=1,2,-3", "9")
    assert random_seed(args) == 9
    assert points(args) == ["prostate=1,2,-3"]
    assert random_seed(seeds()) == 1


def test_seed_that_is_neither_is_wrong_usage() -> None:
    with pytest.raises(UsageError, match=r"--seed five: give a whole number, or NAME=X,Y,Z"):
        random_seed(seeds("five"))
    with pytest.raises(UsageError, match=r"--seed -1: give a number from 0"):
        random_seed(seeds("-1"))
    with pytest.raises(UsageError, match=r"prostate=1,2,3: only `segment` and `analyze`"):
        no_points(seeds("prostate=1,2,3"))


def test_doctor_speaks_where_other_commands_cannot_load() -> None:
    code = "import sys; sys.modules['SimpleITK'] = None; import palpate.ui.cli.main as m; sys.exit(m.main(['doctor', '-h']))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert "usage: palpate doctor" in done.stdout


HELP_OF_ALL = """
import contextlib, io, sys
import palpate.ui.cli.main as cli
for given in (["--help"], ["--version"], *([name, "--help"] for name in cli.COMMANDS)):
    with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.suppress(SystemExit):
        cli.main(given)
    heavy = {"scipy", "numba", "vtkmodules", "pyvista", "skimage", "SimpleITK", "pydicom", "matplotlib", "PySide6"} & set(sys.modules)
    heavy |= {"numpy"} & set(sys.modules) if len(given) == 1 else set()
    print(*given, len(said.getvalue()) > 10, sorted(heavy))
"""


def test_help_loads_no_large_library() -> None:
    """So that it comes at once; neither does the version. One process, in which nothing was loaded before."""
    done = subprocess.run([sys.executable, "-c", HELP_OF_ALL], capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert len(lines) == len(cli.COMMANDS) + 2
    assert [line for line in lines if not line.endswith("True []")] == []


NO_CASE = """
import sys
import palpate.ui.cli.main as cli
for name in (["segment"], ["mesh"], ["identify"], ["diagnose"], ["report"], ["plan"], ["export", "out", "--to", "nrrd"]):
    status = cli.main([name[0], "none", *name[1:]])
    print(status, sorted({"numba", "vtkmodules", "pyvista", "pydicom", "matplotlib"} & set(sys.modules)))
"""


def test_a_missing_case_is_told_before_any_large_library_is_loaded(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", NO_CASE], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout.splitlines() == 7 * ["3 []"]
    assert done.stderr.count("none is no folder") == 7


def test_every_command_explains_itself() -> None:
    for name in cli.COMMANDS:
        module = cli.command_module(name)
        assert module.__doc__ and module.HELP and name == module.NAME
        with pytest.raises(SystemExit, match="0"):
            cli.parser([name]).parse_args([name, "--help"])


def test_validate_writes_what_it_tells(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    given = [
        "validate",
        "robustness",
        "--scenes",
        "2",
        "--seed",
        "3",
        "--workers",
        "1",
        "-o",
        str(tmp_path / "f.json"),
        "--json",
        "--quiet",
    ]
    assert cli.main(given) == 0
    told = json.loads(capfd.readouterr().out)
    assert (told["scenes"], told["seed"]) == (2, 3)
    assert json.loads((tmp_path / "f.json").read_text()) == told


@pytest.mark.parametrize(
    "given, said",
    [
        (["analyse", "a", "b"], "there is no 'analyse'; did you mean analyze?"),
        (["analyze", "a", "b"], "-o/--output missing; see palpate analyze --help"),
        (["export", "case", "out", "--to", "dicom-sge"], "did you mean dicom-seg?"),
        (["segment", "case", "--seed", "prostate"], "give a whole number, or NAME=X,Y,Z"),
        (["report", "My", "case", "1"], "'case 1' is too much; put a path with blanks in quotation marks"),
        (["report", "case", "--pictures"], "unrecognized arguments: --pictures; see palpate"),
    ],
)
def test_wrong_usage_is_one_line_that_helps(given: list[str], said: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert cli.main(given) == 2
    (line,) = capfd.readouterr().err.strip().splitlines()
    assert said in line
