"""Structure names of several languages and habits."""

from __future__ import annotations

import pytest

from palpate.core.errors import InputError
from palpate.imaging.contours.roi_names import choose_rois


@pytest.mark.parametrize(
    ("name", "organ"),
    [
        ("Prostate", "prostate"),
        ("PROSTATA", "prostate"),
        ("prostata sinistra", "prostate_left"),
        ("Prostate_R", "prostate_right"),
        ("Vescica", "bladder"),
        ("Harnblase", "bladder"),
        ("vessie", "bladder"),
        ("Vejiga", "bladder"),
        ("Retto", "rectum"),
        ("Rektum", "rectum"),
        ("Recto", "rectum"),
        ("Testa femorale sx", "bone"),
        ("Tête fémorale gauche", "bone"),
        ("Hüftkopf links", "bone"),
        ("FemoralHead (Left)", "bone"),
        ("Cabeza femoral", "bone"),
    ],
)
def test_names_of_organs(name: str, organ: str) -> None:
    assert choose_rois([name], "rs")[0] == {organ: [name]}


@pytest.mark.parametrize(
    "name", ["PTV prostate", "Rectum_PRV", "Prostate 5mm", "Prostata+VS", "Vescicole seminali", "Rectal wall"]
)
def test_volumes_made_from_an_organ_are_not_it(name: str) -> None:
    assert choose_rois([name], "rs")[0] == {}


def test_a_plain_name_goes_before_others() -> None:
    chosen, notes = choose_rois(["Prostate_DL", "Prostata", "Prostate_MBS"], "rs")
    assert chosen == {"prostate": ["Prostata"]}
    assert notes == ["prostate is Prostata; not used: Prostate_DL, Prostate_MBS"]


def test_unclear_names_are_listed_and_chosen_by_the_caller() -> None:
    names = ["Prostate_DL", "Prostate_MBS", "Bladder"]
    with pytest.raises(
        InputError,
        match="rs has several structures for prostate: Prostate_DL, Prostate_MBS; choose one with --roi prostate=NAME",
    ):
        choose_rois(names, "rs")
    assert choose_rois(names, "rs", {"prostate": ["Prostate_DL"]})[0]["prostate"] == ["Prostate_DL"]
    with pytest.raises(InputError, match="several structures for bladder: Bladder, bladder"):
        choose_rois(["Bladder", "bladder"], "rs")


def test_wrong_choices_are_refused() -> None:
    with pytest.raises(InputError, match="has no structure 'Prostat'; it has Bladder"):
        choose_rois(["Bladder"], "rs", {"prostate": ["Prostat"]})
    with pytest.raises(InputError, match="--roi liver is no organ; known are prostate"):
        choose_rois(["Bladder"], "rs", {"liver": ["Bladder"]})
