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
        # TG-263.
        ("Femur_Head_L", "bone"),
        ("FemoralHead_L", "bone"),
        ("FemoralHead_R", "bone"),
        ("Bone_Pelvic", "bone"),
        ("Bladder", "bladder"),
        ("Rectum~", "rectum"),
        # TotalSegmentator.
        ("urinary_bladder", "bladder"),
        ("hip_right", "bone"),
        ("femur_left", "bone"),
        ("vertebrae_L5", "bone"),
        # 3D Slicer's terminology.
        ("Urinary bladder", "bladder"),
        ("Structure of prostate", "prostate"),
        # Portuguese, Dutch, German.
        ("Pr\u00f3stata", "prostate"),
        ("Pro\u0301stata", "prostate"),
        ("bexiga", "bladder"),
        ("Reto", "rectum"),
        ("Cabe\u00e7a femoral D", "bone"),
        ("prostaat", "prostate"),
        ("blaas", "bladder"),
        ("heupkop links", "bone"),
        ("Stei\u00dfbein", "bone"),
        ("Hueftkopf re", "bone"),
        # Habits: case, blanks, numbers, words run together.
        ("RettoAno", "rectum"),
        ("RETTOANO", "rectum"),
        ("  prostata ", "prostate"),
        ("02_Prostata", "prostate"),
        ("harn-blase", "bladder"),
        ("urinarybladder", "bladder"),
        ("LFemHead", "bone"),
        ("FEMURSX", "bone"),
        ("ProstataDX", "prostate_right"),
        ("Prostate  left", "prostate_left"),
    ],
)
def test_names_of_organs(name: str, organ: str) -> None:
    assert choose_rois([name], "rs")[0] == {organ: [name]}


@pytest.mark.parametrize(
    "name",
    [
        "PTV prostate",
        "Rectum_PRV",
        "Prostate 5mm",
        "Prostata+VS",
        "Vescicole seminali",
        "Rectal wall",
        "gallbladder",
        "Gall Bladder",
        "bladder neck",
        "Harnblasenwand",
        "Prostate_TZ",
        "Urethra prostatica",
        "Femoral artery L",
        "rectus femoris",
        "Pelvic nodes",
        "Rectum balloon",
        "PTV_Prostate",
        "Prostatabett",
        "spleen",
        "Label 1",
    ],
)
def test_volumes_made_from_an_organ_are_not_it(name: str) -> None:
    assert choose_rois([name], "rs")[0] == {}


def test_a_plain_name_goes_before_others() -> None:
    chosen, notes = choose_rois(["Prostate_DL", "Prostata", "Prostate_MBS"], "rs")
    assert chosen == {"prostate": ["Prostata"]}
    assert notes == ["prostate is Prostata; not used: Prostate_DL, Prostate_MBS"]


def test_a_rectum_with_the_anus_goes_before_other_sets_and_after_a_plain_one() -> None:
    names = ["Rectum_DL", "RettoAno", "Rectum_MBS"]
    assert choose_rois(names, "rs")[0] == {"rectum": ["RettoAno"]}
    assert choose_rois([*names, "Retto"], "rs")[0] == {"rectum": ["Retto"]}


def test_a_callers_choice_by_number_case_and_comma() -> None:
    names, numbers = ["Pr\u00f3stata", "Organ, total", "x"], {"Pr\u00f3stata": 4, "Organ, total": 7, "x": 9}
    wanted = {"prostate": ["pro\u0301stata"], "bladder": ["Organ", " total"], "rectum": ["9"]}
    assert choose_rois(names, "rs", wanted, numbers)[0] == {
        "prostate": names[:1],
        "bladder": names[1:2],
        "rectum": ["x"],
    }


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
