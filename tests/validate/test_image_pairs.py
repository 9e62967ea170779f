"""The study of what images add: sealed pairs, three ways to an answer, a table that tells what holds and what raises an alarm."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.steps.simulate.spec import parse_spec
from palpate.core.errors import Cancelled, ConvergenceError, InputError
from palpate.ui.cli import main as cli
from palpate.ui.cli.arguments import UsageError
from palpate.ui.cli.main import arguments
from palpate.validate.images import pairs, study
from palpate.validate.images.figures import way_row
from palpate.validate.images.pairs import STIFFNESS_KPA, drawn_spec, make_pair, unmade
from palpate.validate.images.records import ImagesOptions
from palpate.validate.images.said import Said
from palpate.validate.images.study import images_text, run
from palpate.validate.images.ways import WAYS, Run
from palpate.validate.sealed import run_alone

SCANS = ((Path("/a/ct"), Path("/a/contours.dcm")), (Path("/b/ct"), Path("/b/contours.dcm")))
TRUE = {"prostate_left": 20.0, "prostate_right": 60.0}


def test_every_way_runs_commands_that_the_program_has(tmp_path: Path) -> None:
    asked: list[tuple[str, ...]] = []

    def note(at: Path, words: tuple[str, ...]) -> None:
        asked.append(words)
        arguments([*words, "--quiet", "--workers", "1"])
        if words[0] == "mesh":
            CaseFolder.create(at / words[1], CaseFacts(words[1])).write_json("result.json", {})
            (at / words[1] / "mesh.npz").write_bytes(b"")

    for way in WAYS.values():
        way(tmp_path, Run(note))
    told = [" ".join(words) for words in asked]
    assert [line for line in told if line.startswith(("identify", "diagnose"))] == [
        "identify contours --no-map --method gauss-newton --no-image",
        "diagnose contours --no-image",
        "identify images --no-map --method gauss-newton --image",
        "diagnose images --image",
        "identify one_scan --no-map --method gauss-newton --image",
        "diagnose one_scan --image",
        "identify automatic --no-map --method gauss-newton --image",
        "diagnose automatic --image",
    ]
    assert [line for line in told if "deformed-labels" in line] == [told[0]]
    assert (tmp_path / "images" / "mesh.npz").exists()
    assert not (tmp_path / "images" / "result.json").exists()


def test_images_need_the_mesh_of_contours(tmp_path: Path) -> None:
    (tmp_path / "contours").mkdir()
    asked: list[tuple[str, ...]] = []
    WAYS["images"](tmp_path, Run(lambda at, words: asked.append(words)))
    assert not asked


def test_images_alone_make_a_case_of_their_own(tmp_path: Path) -> None:
    asked: list[str] = []
    WAYS["images"](tmp_path, Run(lambda at, words: asked.append(" ".join(words))))
    assert [line.split()[0] for line in asked] == ["import", "segment", "mesh", "identify", "diagnose"]
    assert "--deformed-labels scans/contours/deformed.nii.gz" in asked[0]


def test_contours_that_err_as_asked_say_so_and_a_diagnosis_may_be_left_out(tmp_path: Path) -> None:
    asked: list[str] = []

    def note(at: Path, words: tuple[str, ...]) -> None:
        asked.append(words[0])
        if words[0] == "import":
            CaseFolder.create(at / words[words.index("-o") + 1], CaseFacts("c"))

    WAYS["images"](tmp_path, Run(note, 1.0, False))
    assert asked == ["import", "segment", "mesh", "identify"]
    assert CaseFolder(tmp_path / "images").facts.boundary_noise_sd_mm == 1.0
    WAYS["automatic"](tmp_path, Run(note, 1.0, False))
    assert CaseFolder(tmp_path / "automatic").facts.boundary_noise_sd_mm is None  # nobody drew anything


def test_a_specification_is_one_that_simulate_takes() -> None:
    spec = parse_spec(drawn_spec(*SCANS[0], np.array([20.0, 60.0]), np.random.default_rng(1)))
    assert list(spec.stiffness.organ.values()) == [20.0, 60.0]
    assert spec.contour_noise_sd_mm == pairs.CONTOUR_SD_MM


def test_a_motion_that_folds_is_drawn_anew_and_the_stiffness_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[Mapping[str, object]] = []

    def simulate(spec: Mapping[str, object], case: Path, answers: Path, mesh_cache: Path) -> Mapping[str, object]:
        assert mesh_cache == tmp_path / "meshes"
        tried.append(spec)
        if len(tried) < 3:
            raise ConvergenceError(f"the tissue folds, {len(tried)}")
        return {"true_G_kpa": spec["stiffness_kpa"]}

    monkeypatch.setattr(pairs, "run_simulate", simulate)
    options = ImagesOptions(SCANS, 2, 7)
    assert make_pair(options, 1, tmp_path)
    assert len({json.dumps(spec["stiffness_kpa"]) for spec in tried}) == 1
    assert len({json.dumps(spec["walls"]) for spec in tried}) == 3
    assert {json.dumps(spec["source"]) for spec in tried} == {json.dumps({"ct": "/b/ct", "labels": "/b/contours.dcm"})}
    G = json.loads((tmp_path / "answers" / "pair_0001.json").read_text())["true_G_kpa"]
    assert all(STIFFNESS_KPA[0] <= value <= STIFFNESS_KPA[1] for value in G.values())
    assert make_pair(options, 1, tmp_path)
    assert len(tried) == 3  # made already
    tried.clear()
    monkeypatch.setattr(pairs, "ATTEMPTS", 2)
    assert not make_pair(options, 0, tmp_path)
    assert not (tmp_path / "answers" / "pair_0000.json").exists()
    assert unmade(tmp_path, "pair_0000") == ["the tissue folds, 1", "the tissue folds, 2"]
    assert unmade(tmp_path, "pair_0001") == []
    assert not make_pair(options, 0, tmp_path)
    assert len(tried) == 2  # known not to go


def test_a_pair_hides_its_effect_and_keeps_it_when_the_motion_is_drawn_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[Mapping[str, object]] = []

    def simulate(spec: Mapping[str, object], case: Path, answers: Path, mesh_cache: Path) -> Mapping[str, object]:
        tried.append(spec)
        if len(tried) == 1:
            raise ConvergenceError("the tissue folds")
        return {"true_G_kpa": spec["stiffness_kpa"]}

    monkeypatch.setattr(pairs, "run_simulate", simulate)
    effects = tuple(pairs.HIDE)
    options = ImagesOptions(SCANS, 6, 7, hide=effects)
    for number in range(6):
        assert make_pair(options, number, tmp_path)
    assert len({json.dumps(spec["hidden"]) for spec in tried[:2]}) == 1
    hidden = ["".join(spec["hidden"]) for spec in tried[1:]]  # type: ignore[arg-type]
    assert hidden == [*("" if effect == "nothing" else effect for effect in effects), effects[0]]
    assert json.dumps(tried[1]["hidden"]) != json.dumps(tried[-1]["hidden"])
    assert [len(parse_spec(spec).hidden) for spec in tried] == [1, 1, 1, 1, 1, 0, 1]
    # What is not hidden is drawn as in a study that hides nothing.
    plain = len(tried)
    assert make_pair(ImagesOptions(SCANS, 4, 7), 3, tmp_path / "plain")
    assert {**tried[plain], "hidden": None} == {**tried[4], "hidden": None}


def test_every_second_pair_of_each_scan_differs_in_more_than_its_motion(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Mapping[str, object]] = []

    def simulate(spec: Mapping[str, object], case: Path, answers: Path, mesh_cache: Path) -> Mapping[str, object]:
        made.append(spec)
        return {}

    monkeypatch.setattr(pairs, "run_simulate", simulate)
    for number in range(24):
        make_pair(ImagesOptions(SCANS, 24, 7), number, tmp_path)
    changes = [parse_spec(spec).scan.changes for spec in made]
    assert not any(changes[k] for k in range(24) if k % 4 < 2)
    drawn = [changes[k] for k in range(24) if k % 4 >= 2]
    assert set().union(*drawn) == set(pairs.CHANGES)
    assert len(set(drawn)) > 3
    # Each scan's own noise counts once.
    noise = [parse_spec(spec).scan.rest_noise for spec in made]
    assert noise == ["own"] * len(SCANS) + ["anew"] * (24 - len(SCANS))


def _truth(options: ImagesOptions, number: int) -> Mapping[str, object]:
    hides = options.hide[number % len(options.hide)] if options.hide else ""
    return {
        "true_G_kpa": TRUE,
        "spec": {"hidden": {hides: {}} if hides else {}, "scan": {"changes": ["contrast"] if number else []}},
        "hidden": {"shown_mm": 0.3, "left_mm": 0.2} if hides else None,
    }


def _made(options: ImagesOptions, number: int, folder: Path) -> bool:
    if number == 2:
        (folder / "unmade").mkdir(exist_ok=True)
        (folder / "unmade" / "pair_0002.txt").write_text("the walls swing\nthe tissue folds\n")
        return False
    (folder / "cases" / f"pair_{number:04d}").mkdir(parents=True, exist_ok=True)
    (folder / "answers").mkdir(exist_ok=True)
    (folder / "answers" / f"pair_{number:04d}.json").write_text(json.dumps(_truth(options, number)))
    return True


def _analysed(
    pair: Path, timeout_s: float, ways: tuple[str, ...], stated_mm: float | None = None, diagnosis: bool = True
) -> None:
    """Contours are right within an sd of 0.4; images a standard deviation of 0.1 too soft on the left, and raise an alarm on pair 0."""
    assert pair.name in json.loads((pair.parents[1] / "ledger.json").read_text())["answers"]
    for way, sd in (("contours", 0.4), ("images", 0.1)):
        case = CaseFolder.create(pair / way, CaseFacts(way))
        found = {
            name: {
                "G_kpa": G * (np.exp(-3.0 * sd) if (way, name) == ("images", "prostate_left") else 1.0),
                "sd_ln_G": sd,
            }
            for name, G in TRUE.items()
        }
        case.write_json("result.json", {"parameters": found})
        alarm = way == "images" and pair.name == "pair_0000"
        case.write_json(
            "diagnosis.json",
            {
                "verdict": "ambiguous" if alarm else "none",
                "candidates": ["inclusion", "prestress"] if alarm else [],
                "gap": {"p_value": 0.01 if alarm else 0.6},
                "posterior": {"none": 0.2, "inclusion": 0.8} if alarm else {"none": 1.0},
            },
        )
    (pair / "done.json").write_text("{}")


def test_the_table_tells_what_holds_and_what_raises_an_alarm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[Path] = []
    monkeypatch.setattr(study, "contoured_scan", lambda ct, contours, name: read.append(ct))
    monkeypatch.setattr(study, "make_pair", _made)
    monkeypatch.setattr(study, "analyse", _analysed)
    found = run(tmp_path, ImagesOptions(SCANS, 3, 5))
    assert found["short"] == 1
    assert found["unmade"] == {"pair_0002": ["the walls swing", "the tissue folds"]}
    contours, images, one_scan, _ = found["rows"]
    assert contours["halves"] is not None
    assert images["halves"] is not None
    assert [contours["halves"]["intervals"][-1]["holds"], images["halves"]["intervals"][-1]["holds"]] == [1.0, 0.5]
    assert images["sd_ratio"] == pytest.approx(0.25)
    assert (contours["alarms"], images["alarms"]) == (0.0, 0.5)
    assert images["p_values"] == [0.01, 0.6]
    assert (one_scan["halves"], one_scan["failed"]) == (None, 2)
    left = [row for row in found["halves"] if row["way"] == "images" and row["half"] == "prostate_left"]
    assert [row["z"] for row in left] == [-3.0, -3.0]
    text = images_text(found)
    # The sum has the sign of its rows, which is that of the error: too soft is negative.
    assert "images: 2 of 4 intervals hold; z mean -1.50, rms 2.12" in text
    assert text.endswith("1 pairs could not be simulated\n  pair_0002: the tissue folds")
    assert "one_scan: no answer on any pair" in text
    with pytest.raises(InputError, match="was made with --seed 5"):
        run(tmp_path, ImagesOptions(SCANS, 3, 6))
    assert read[:2] == [SCANS[0][0], SCANS[1][0]]


def test_the_table_tells_which_hidden_effects_were_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "contoured_scan", lambda ct, contours, name: None)
    monkeypatch.setattr(study, "make_pair", _made)
    monkeypatch.setattr(study, "analyse", _analysed)
    found = run(tmp_path, ImagesOptions(SCANS, 2, 5, hide=("inclusion",), ways=("contours", "images")))
    contours, images = found["rows"]
    assert contours["found"]["inclusion"] == {"pairs": 2, "candidate": 0, "alone": 0, "alarm": 0, "other": 0}
    assert images["found"]["inclusion"] == {"pairs": 2, "candidate": 1, "alone": 0, "alarm": 1, "other": 0}
    assert (images["alarms"], images["p_values"]) == (None, [])  # none of these pairs can raise a false one
    text = images_text(found)
    assert "ambiguous: inclusion, prestress (p 0.01)  hides inclusion, 0.20 mm" in text
    assert "hides inclusion, 0.20 mm  changed: contrast" in text
    assert "inclusion: of 2 pairs a candidate in 1, the only name in 0, an alarm in 1" in text
    with pytest.raises(InputError, match="--hide inclusion --way contours --way images"):
        run(tmp_path, ImagesOptions(SCANS, 2, 5))


@pytest.mark.parametrize(
    ("verdict", "counted"),
    [
        ("inclusion", {"candidate": 1, "alone": 1, "alarm": 1, "other": 0}),
        ("prestress", {"candidate": 0, "alone": 0, "alarm": 1, "other": 1}),
        ("unknown", {"candidate": 0, "alone": 0, "alarm": 1, "other": 0}),
        ("none", {"candidate": 0, "alone": 0, "alarm": 0, "other": 0}),
    ],
)
def test_a_verdict_counts_as_what_it_is(verdict: str, counted: Mapping[str, int]) -> None:
    said = Said("pair_0000", "images", {}, {}, verdict, 0.01, (), "inclusion", 0.2)
    assert way_row("images", [said], 1, {}, 1)["found"]["inclusion"] == {"pairs": 1, **counted}


def test_the_options_name_what_there_is() -> None:
    scan = ["--scan", "ct", "contours.dcm"]
    ways = [word for way in WAYS for word in ("--way", way)]
    hide = [word for effect in pairs.HIDE for word in ("--hide", effect)]
    asked = arguments(["validate", "images", *scan, *ways, *hide])
    assert (asked.way, asked.hide) == (list(WAYS), list(pairs.HIDE))
    with pytest.raises(UsageError):
        arguments(["validate", "images", *scan, "--hide", "fog"])


def test_a_folder_that_holds_a_study_of_another_kind_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study, "contoured_scan", lambda ct, contours, name: None)
    (tmp_path / "ledger.json").write_text(json.dumps({"seed": 5, "simulator": "blind", "effect": None}))
    with pytest.raises(InputError, match="was made with another command"):
        run(tmp_path, ImagesOptions(SCANS, 3, 5))
    # Pairs of another simulator do not join those that are there.
    (tmp_path / "ledger.json").write_text(json.dumps({**study._kind(ImagesOptions(SCANS, 3, 5)), "making": 2}))
    with pytest.raises(InputError, match=rf"way 2\).*way {pairs.MAKING}\)"):
        run(tmp_path, ImagesOptions(SCANS, 3, 5))


def test_scans_that_cannot_be_read_begin_no_study(tmp_path: Path) -> None:
    (tmp_path / "ct").mkdir()
    with pytest.raises(InputError, match="ct"):
        run(tmp_path / "study", ImagesOptions(((tmp_path / "ct", tmp_path / "contours.dcm"),), 1, 5))
    assert not (tmp_path / "study").exists()


def test_the_command_wants_real_scans(capfd: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["validate", "images", "--quiet"]) == 2
    assert "give --scan CT CONTOURS" in capfd.readouterr().err


@pytest.mark.parametrize("status", [0, 3, 130])
def test_a_command_that_somebody_stopped_is_no_answer(tmp_path: Path, status: int) -> None:
    """What the command says of its case is one; a stop ends the study, which goes on from there the next time."""
    command = [sys.executable, "-c", f"import sys; print('said'); sys.exit({status})"]
    if status == 130:
        with pytest.raises(Cancelled, match="run the study again"):
            run_alone(command, tmp_path, "log", 60.0)
    else:
        run_alone(command, tmp_path, "log", 60.0)
    assert (tmp_path / "log").read_text() == "said\n"
