"""The command in a report's provenance: the parser takes it back, and no path is in it."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from palpate.ui.cli import main as cli
from palpate.ui.cli.steps import typed_options

LINES = {
    "analyze /d/Doe/a /d/Doe/b -o /d/Doe/case": "analyze REST DEFORMED -o CASE",
    "analyze /d/Doe/a /d/Doe/b -o /d/Doe/c --rest-labels /d/Doe/r.nii --no-map --method gauss-newton --same-patient --workers 1":
        "analyze REST DEFORMED -o CASE --rest-labels FILE --same-patient --method gauss-newton --no-map",
    "analyze /d/Doe/a b -o c --seed 4 --seed prostate=-6.5,11,-148 --roi 'prostate=PTV 1' --model monai:/d/Doe":
        "analyze REST DEFORMED --seed 4 --seed prostate=-6.5,11,-148 -o CASE --roi 'prostate=PTV 1' --model monai:FOLDER",
    "import /d/Doe/a b -o c --more /d/Doe/x.nii --more /d/Doe/y.nii --name 'case 7'":
        "import REST DEFORMED -o CASE --name 'case 7' --more DEFORMED --more DEFORMED",
    "identify /d/Doe --repeat rest=/d/Doe/again.nii --particles 20": "identify CASE --repeat rest=LABELS --particles 20",
    "diagnose /d/Doe --effects /d/Doe/mine --meshes 3": "diagnose CASE --effects FOLDER --meshes 3",
    "segment /d/Doe --extremes 'prostate=1,2,3;4,5,6'": "segment CASE --extremes 'prostate=1,2,3;4,5,6'",
}  # fmt: skip


@pytest.mark.parametrize("line", LINES)
def test_what_is_noted_is_what_was_typed_without_paths_and_defaults(line: str) -> None:
    given = shlex.split(line)
    args = cli.parser(given).parse_args(given)
    noted = f"{args.command} {typed_options(args, args._module)}"
    assert noted == LINES[line]
    assert "Doe" not in noted
    again = cli.parser(shlex.split(noted)).parse_args(shlex.split(noted))
    same = [
        name
        for name, value in vars(args).items()
        if isinstance(value, bool | int | str) and name not in ("workers", "model")
    ]
    assert {name: getattr(again, name) for name in same} == {name: getattr(args, name) for name in same}


def test_every_command_of_a_case_can_be_noted() -> None:
    for command in ("report", "mesh", "plan"):
        args = cli.parser([command]).parse_args([command, str(Path("Doe"))])
        assert typed_options(args, args._module) == "CASE"
