"""What ARCHITECTURE.md calls one file is one: a law, an effect, an exporter and a command, each written by its table's row alone, are
dropped into their folder and found."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import palpate
from palpate.core import laws
from palpate.core.diagnose import effects
from palpate.core.diagnose.bench_bodies.on_bench import on_bench
from palpate.core.errors import InputError
from palpate.core.identify.options import IdentifyOptions
from palpate.ui import export
from palpate.ui.cli import commands, main

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "fixtures"))
from phantoms import write_case

LAW = '''
"""Neo-Hookean with its parameters in another order."""
from palpate.core.laws.base import Law
from palpate.core.laws.neo_hookean import NEO_HOOKEAN

def _kernel(F, p, *out):
    NEO_HOOKEAN.kernel(F, p[:, ::-1].copy(), *out)

MINE = Law("mine", ("K", "G"), _kernel, lambda p: p[:, 0].copy(), lambda p: p[:, 1].copy())
'''
EFFECT = """
from palpate.core.diagnose.effects import Effect, Parameter, Variant

EFFECT = Effect("mine", "something of mine", (Parameter("size", "1", 1.0),), lambda around: [], "a look", on_bench={})
"""
EXPORTER = """
WRITES = "the name of a case"

def export(case, folder):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "name.txt").write_text(case.facts.name)
    return [folder / "name.txt"]
"""
COMMAND = '''
"""Says what it is given."""
NAME, HELP = "my-word", "says a word"

def add_arguments(parser):
    parser.add_argument("word")

def run(args, console):
    return {"word": args.word}, args.word
'''


@pytest.fixture
def dropped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[object]:
    """Puts a file into a package's folder: into one more folder of the package, which is taken away again."""
    names = []

    def drop(package: object, module: str, text: str) -> None:
        (tmp_path / f"{module}.py").write_text(text)
        importlib.invalidate_caches()
        monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])  # type: ignore[attr-defined]
        names.append((package, module))

    yield drop
    for package, module in names:
        sys.modules.pop(f"{package.__name__}.{module}", None)  # type: ignore[attr-defined]
        vars(package).pop(module, None)


def test_an_exporter(dropped, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:  # type: ignore[no-untyped-def]
    dropped(export, "my_form", EXPORTER)
    case, out = write_case(tmp_path / "case"), tmp_path / "out"
    assert main.main(["export", str(case.path), "--to", "my-form", str(out), "--quiet"]) == 0
    assert (out / "name.txt").read_text() == case.facts.name
    assert main.main(["export", str(case.path), "--to", "my-form", str(out), "--tissue"]) == 3
    assert "my-form writes no labels that the tissue could be kept among" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ("export", "CASE", "--to", "dicom-seg", "SCAN"),
        ("drop", "CASE", "-o", "SCAN/film.mp4"),
        ("touch", "CASE", "--headless", "--script", "SCRIPT", "-o", "SCAN"),
    ],
)
def test_nothing_is_written_into_a_scan_of_the_case(
    words: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case, script = write_case(tmp_path / "case", ct=True), tmp_path / "script.txt"
    script.write_text("press 1\n")
    places = {"CASE": case.path, "SCAN": case.file("rest_ct"), "SCRIPT": script}
    before = sorted(path.name for path in case.file("rest_ct").iterdir())
    given = [next((w.replace(k, str(p)) for k, p in places.items() if w.startswith(k)), w) for w in words]
    assert main.main(given) == 3
    assert "whose slices it would join" in capsys.readouterr().err
    assert sorted(path.name for path in case.file("rest_ct").iterdir()) == before


def test_a_command(dropped, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:  # type: ignore[no-untyped-def]
    assert list(main.find_commands()) == list(main.COMMANDS) and "identify" in main.COMMANDS
    dropped(commands, "my_word", COMMAND)
    monkeypatch.setattr(main, "COMMANDS", main.find_commands())
    assert main.main(["my-word", "hello"]) == 0 and "hello" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main.main(["--help"])
    assert "says a word" in capsys.readouterr().out


def test_a_law_is_the_organs(dropped, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(
        InputError, match="law 'mine' is unknown; choose one of linear, linear-stiffening, mooney-rivlin"
    ):
        IdentifyOptions(law="mine")
    dropped(laws, "my_law", LAW)
    monkeypatch.setitem(laws.LAWS, "mine", laws._find_laws()["mine"])
    ball = palpate.example_sphere(G=60.0, fineness=2)
    asked = {**ball, "noise_sd_mm": 0.05, "element": "p1p1", "starts": 1}
    mine = palpate.identify(**asked, law="mine")
    assert mine.G_kpa["region_1"] == pytest.approx(60.0, rel=0.25)
    assert (
        mine.record.options.law == "mine"
        and "G is the initial shear modulus of the law mine" in mine.record.identifiability.verdict
    )


@pytest.mark.parametrize("on_a_bench", [True, False])
def test_an_effect_with_a_place_on_a_bench_or_none(dropped, on_a_bench: bool) -> None:  # type: ignore[no-untyped-def]
    before = set(effects.library())
    dropped(effects, "my_effect", EFFECT.format(on_a_bench))
    library = effects.library()
    assert set(library) == before | {"mine"}
    assert ("mine" in on_bench(library, None)) == on_a_bench  # type: ignore[arg-type]
