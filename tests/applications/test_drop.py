"""`palpate drop`: what it refuses, what its film holds, and that a film is whole or absent."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from films import read_film

from palpate.applications.drop import fall as drop_step
from palpate.applications.drop import film as drop_film
from palpate.applications.drop.canvas import Canvas, slower
from palpate.applications.drop.fallen import stage_of
from palpate.applications.drop.stage import DropStage
from palpate.applications.dynamics.drop import DropOptions, dish_for
from palpate.applications.film import write_film
from palpate.case.case_folder import CaseFacts, CaseFolder
from palpate.core.errors import Cancelled, InputError
from palpate.core.fem.meshes import box, with_regions
from palpate.ui.cli import main as cli
from palpate.ui.pictures import offscreen

G = {"prostate_left": 12.0, "prostate_right": 30.0}


def identified(folder: Path, G: dict[str, float] = G, name: str = "Kowalski") -> CaseFolder:
    """A case whose organ is a small block in tissue, +x the patient's left."""
    case = CaseFolder.create(folder, CaseFacts(name))
    mesh = box((24.0, 16.0, 14.0), (4, 2, 3), jitter=0.1, seed=1)
    mesh = with_regions(mesh, lambda x: np.where(x[:, 2] > 11.0, 3, np.where(x[:, 0] > 12.0, 1, 2)))
    case.write_npz("mesh.npz", points=mesh.points, cells=mesh.cells, regions=mesh.regions)
    case.write_json("result.json", {"parameters": {k: {"G_kpa": v} for k, v in G.items()}})
    return case


@pytest.fixture(scope="module")
def dropped(tmp_path_factory: pytest.TempPathFactory) -> drop_step.Dropped:
    """Two organs, one stiffer, on their way for 30 ms."""
    folder = tmp_path_factory.mktemp("drop")
    cases = [identified(folder / "a"), identified(folder / "b", {"prostate_left": 90.0, "prostate_right": 95.0})]
    return drop_step.run(cases, DropOptions(height=1.5, seconds=0.03, frames=100.0))


@pytest.fixture(scope="module")
def stage(dropped: drop_step.Dropped) -> DropStage:
    return stage_of(dropped, 30.0)


def test_the_organ_alone_falls_with_the_stiffness_of_its_sides(dropped: drop_step.Dropped) -> None:
    assert [organ.name for organ in dropped.organs] == ["A", "B"]
    assert dropped.organs[0].stiffness_kpa == {1: 12.0, 2: 30.0}
    soft, stiff = dropped.drops
    assert set(soft.regions.tolist()) == {1, 2}
    assert soft.times == pytest.approx([0.0, 0.01, 0.02, 0.03])
    for one in dropped.drops:
        assert one.figures["landed"]
        assert one.figures["fall_mm"] == pytest.approx(1.2, abs=0.05)  # to the edge of the dish's layer
        assert abs(one.figures["fall_time_error"]) < 0.01
        assert one.figures["deepest_penetration_mm"] == 0.0
        assert one.figures["energy_growth"] <= 1e-3
    assert np.abs(soft.points[0] - stiff.points[0]).max() == 0.0
    assert np.abs(soft.points[-1] - stiff.points[-1]).max() > 0.2
    # +z is up and the patient's left is +x, as in the scan.
    left = soft.points[0][np.unique(soft.faces[soft.regions == 1])]
    assert left[:, 0].min() == pytest.approx(0.0, abs=1.5)


def test_a_films_arrays_travel_whole(stage: DropStage, tmp_path: Path) -> None:
    stage.save(tmp_path / "stage.npz")
    again = DropStage.load(tmp_path / "stage.npz")
    assert again.organs[1].subtitle == stage.organs[1].subtitle == "shear modulus G: left 90.0 kPa, right 95.0 kPa"
    assert again.bar == stage.bar
    assert (again.organs[0].points == stage.organs[0].points).all()
    assert "Kowalski" not in repr(again.organs[0].title) + repr(again.organs[0].subtitle)


def test_the_film_shows_both_organs_time_and_scale(stage: DropStage, tmp_path: Path) -> None:
    path, stage = tmp_path / "film.mp4", replace(stage, size=(320, 360))
    told = list[float]()
    drop_film.make_film(stage, path, lambda fraction, message: told.append(fraction))
    assert told == sorted(told)
    assert told[-1] == 1.0
    film = read_film(path)
    assert len(film) == len(stage.times)
    (width, height), (rows, columns, _) = stage.size, film[0].shape
    assert (columns, rows > height) == (2 * width, True)
    colourful = [picture.max(axis=2).astype(int) - picture.min(axis=2) > 60 for picture in film]
    for half in (slice(0, width), slice(width, None)):  # the organ, coloured on grey and white, comes down
        first, last = (np.argwhere(c[58 : 58 + height, half])[:, 0].mean() for c in (colourful[0], colourful[2]))
        assert last > first + 5
    assert (film[0] != film[-1])[58 + height :].any()  # the time


def test_a_scale_bar_is_as_long_as_it_says(stage: DropStage) -> None:
    frame = drop_film.Frame.around(stage)
    canvas = Canvas(stage, frame.pixels_per_mm)
    blank = np.full((stage.size[1], stage.size[0], 3), 255, dtype=np.uint8)
    picture = canvas.picture([blank, blank], 0.0)
    row = (picture[58 + stage.size[1] + 22].max(axis=1) < 60).astype(int)
    length = int(np.argmin(row[16:]))  # from the left edge to where the ink ends
    assert length == pytest.approx(20.0 * frame.pixels_per_mm, abs=2)
    # In parallel projection a dish's rim is as wide as its points are apart.
    assert 2.0 * frame.half * stage.size[0] / stage.size[1] > float(np.ptp(stage.dish_points[:, 0]))
    assert slower(stage) == pytest.approx(1.0 / (30.0 * 0.01))


def test_a_films_pictures_come_back_in_order_and_colour(tmp_path: Path) -> None:
    colours = [(200, 30, 30), (30, 200, 30), (30, 30, 200)]
    pictures = [np.full((48, 64, 3), c, dtype=np.uint8) for c in colours]
    write_film(tmp_path / "x.mp4", pictures, 25.0)
    for colour, picture in zip(colours, read_film(tmp_path / "x.mp4"), strict=True):
        assert np.abs(picture.reshape(-1, 3).mean(axis=0) - colour).max() < 12
    with pytest.raises(InputError, match="at least one picture"):
        write_film(tmp_path / "none.mp4", [], 25.0)
    with pytest.raises(ValueError, match="even width and height"):
        write_film(tmp_path / "odd.mp4", [pictures[0][:47]], 25.0)
    (tmp_path / "no.mp4").write_bytes(b"no film")
    with pytest.raises(InputError, match="no film that can be read"):
        read_film(tmp_path / "no.mp4")


def spoilt(case: CaseFolder, what: str) -> None:
    if what == "no result":
        case.remove("result.json")
    elif what == "no mesh":
        case.remove("mesh.npz")
    elif what == "cut mesh":
        case.file("mesh.npz").write_bytes(case.file("mesh.npz").read_bytes()[:300])
    elif what == "no organ":
        arrays = case.read_npz("mesh.npz")
        case.write_npz("mesh.npz", **(arrays | {"regions": np.full_like(arrays["regions"], 3)}))
    elif what == "half a result":
        case.write_json("result.json", {"parameters": {"prostate_left": {"G_kpa": 3.0}}})
    else:
        case.write_json("result.json", {"parameters": {k: {"G_kpa": -1.0} for k in G}})


@pytest.mark.parametrize(
    ("what", "told"),
    [
        ("no result", r"result\.json is not there; run `palpate identify`"),
        ("no mesh", r"mesh\.npz is not there; run `palpate mesh`"),
        ("cut mesh", r"mesh\.npz is damaged"),
        ("no organ", r"has no cell in the organ"),
        ("half a result", "has no stiffness for 'prostate_right'"),
        ("below zero", r"says -1\.0 kPa for prostate_left"),
    ],
)
def test_a_case_that_cannot_fall_is_told_in_one_line(tmp_path: Path, what: str, told: str) -> None:
    case = identified(tmp_path / "case")
    spoilt(case, what)
    with pytest.raises(InputError, match=told):
        drop_step.organ_of(case, "A")


def test_the_command_refuses_what_it_cannot_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(offscreen, "check", lambda: None)
    case = str(identified(tmp_path / "case").path)
    film = str(tmp_path / "film.mp4")
    (tmp_path / "shut").mkdir(mode=0o555)
    for given, status, told in (
        ([case, "-o", str(tmp_path / "film.avi")], 3, "whose name ends in .mp4"),
        ([case, case, case, "-o", film], 3, "one case or two"),
        ([case, "-o", str(tmp_path / "shut" / "film.mp4")], 3, "film.mp4 cannot be written"),
        ([str(tmp_path), "-o", film], 3, "has no case.json"),
        ([case, "-o", film, "--height", "-3"], 2, "out of range"),
        ([case], 2, "-o/--output missing"),
    ):
        assert cli.main(["drop", *given, "--quiet"]) == status
        line = capsys.readouterr().err.strip()
        assert told in line
        assert len(line.splitlines()) == 1


def test_a_stop_while_drawing_leaves_no_film_and_keeps_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stopped(stage: DropStage, path: Path, progress: object) -> str:
        path.write_bytes(b"half a film")
        raise Cancelled("cancelled; run the same command again")

    monkeypatch.setattr(offscreen, "check", lambda: None)
    monkeypatch.setattr(drop_film, "make_film", stopped)
    case, film = identified(tmp_path / "case"), tmp_path / "out" / "film.mp4"
    film.parent.mkdir()
    film.write_bytes(b"old")
    given = ["drop", str(case.path), "-o", str(film), "--time", "0.02", "--quiet"]
    assert cli.main(given) == 130
    assert film.read_bytes() == b"old"
    assert [p.name for p in film.parent.iterdir()] == ["film.mp4"]
    capsys.readouterr()
    monkeypatch.setattr(drop_film, "make_film", lambda stage, path, progress: path.write_bytes(b"new") and "vp09")
    assert cli.main([*given, "--json"]) == 0
    assert film.read_bytes() == b"new"
    found = json.loads(capsys.readouterr().out)
    assert found["organs"][0]["G_kpa"] == G
    assert {"energy_growth", "deepest_penetration_mm", "fall_time_s", "rebound_mm", "seconds"} <= set(
        found["organs"][0]
    )
    assert "Kowalski" not in json.dumps(found)


def test_a_dish_holds_the_widest_of_its_organs() -> None:
    meshes = [box((20.0, 30.0, 10.0), (1, 1, 1)), box((44.0, 12.0, 10.0), (1, 1, 1))]
    assert np.ptp(dish_for(meshes).points[:, :2], axis=0).min() > 44.0


def test_quadratic_cells_show_their_mid_edges(tmp_path: Path) -> None:
    case = identified(tmp_path / "case")
    one = drop_step.run([case], DropOptions(height=30.0, seconds=0.01, frames=100.0, element="p2p0")).drops[0]
    linear = drop_step.run([case], DropOptions(height=30.0, seconds=0.01, frames=100.0)).drops[0]
    assert len(one.faces) == len(one.regions) == 4 * len(linear.faces)
    for points, drop in ((one.points[0], one), (linear.points[0], linear)):
        X = points[drop.faces]
        volume = np.einsum("fi,fi->", X[:, 0], np.cross(X[:, 1], X[:, 2])) / 6.0
        assert volume == pytest.approx(24.0 * 16.0 * 10.5, rel=0.2)  # outwards, closed; the tissue is left out
    assert not one.figures["landed"]
    assert one.figures["fall_time_s"] is None


def test_a_machine_that_cannot_draw_says_so_before_and_while_drawing(
    stage: DropStage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def cannot() -> None:
        raise offscreen.OffscreenError("off-screen rendering ended with status -6; try `this`")

    monkeypatch.setattr(offscreen, "check", cannot)
    case = identified(tmp_path / "case")
    assert cli.main(["drop", str(case.path), "-o", str(tmp_path / "film.mp4"), "--quiet"]) == 3
    assert "off-screen rendering ended with status -6" in capsys.readouterr().err
    assert not list(tmp_path.glob("*film*"))
    monkeypatch.setattr(drop_film.sys, "executable", "/bin/false")
    with pytest.raises(offscreen.OffscreenError, match=r"could not be drawn \(status 1\)"):
        drop_film.make_film(stage, tmp_path / "film.mp4")
