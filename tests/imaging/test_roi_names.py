"""Structure names of several languages and habits."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from palpate.core.errors import InputError
from palpate.imaging.contours import organ_words
from palpate.imaging.contours.roi_names import choose_rois
from palpate.imaging.contours.structure_names import label_named, words_of


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


@pytest.mark.parametrize(
    "name",
    [
        "PeriProstatic",
        "Prostate_SemVes",
        "zProstate",
        "z_Rectum",
        "Rectum_Ant",
        "Anti-Bladder",
        "Bladder_Contrast",
        "NVB_Prostate",
        "Prostate 78",
        "Prostate+",
        "!Bladder",
        "\u5468\u56f4Prostate",
    ],
)
def test_a_word_that_is_not_known_is_asked_about(name: str) -> None:
    with pytest.raises(
        InputError, match=r"rs holds no plain \w+, only .* is not known\); give --roi (\w+)=NAME .*=none"
    ) as said:
        choose_rois([name], "rs")
    organ = str(said.value).partition("--roi ")[2].partition("=")[0]
    assert choose_rois([name], "rs", {organ: [name]})[0] == {organ: [name]}
    assert choose_rois([name], "rs", {organ: ["none"]})[0] == {}
    plain = {"prostate": "Prostata", "bladder": "Blase", "rectum": "Rektum"}[organ]
    assert choose_rois([plain, name], "rs") == ({organ: [plain]}, [f"{organ} is {plain}; not used: {name}"])


def test_parts_of_bone_that_are_not_known_are_left_out() -> None:
    assert choose_rois(["Femur_L_Metal", "Femur_R"], "rs") == (
        {"bone": ["Femur_R"]},
        ["bone is Femur_R; not used: Femur_L_Metal"],
    )
    assert choose_rois(["Femur_L_Metal"], "rs") == ({}, [])


# A name with any further word of letters or digits, or sign, that is not on the lists.
KNOWN = frozenset().union(
    *organ_words.ORGAN_WORDS.values(), organ_words.NEUTRAL_WORDS, organ_words.BESIDE_RECTUM, organ_words.DRAWN_BY,
    organ_words.LEFT, organ_words.RIGHT,
)  # fmt: skip
AFFIX = st.text(st.characters(categories=("L", "N", "S", "Po")), min_size=1, max_size=8)


@given(st.sampled_from(["Prostate", "Bladder", "Rectum"]), AFFIX, st.sampled_from(["", "_", " "]), st.booleans())
def test_no_affix_is_taken_silently(organ: str, affix: str, glue: str, before: bool) -> None:
    name = f"{affix}{glue}{organ}" if before else f"{organ}{glue}{affix}"
    try:
        chosen, notes = choose_rois([name], "rs")
    except InputError as error:
        assert name in str(error)
        return
    if chosen:
        told = set(words_of(name)) - {organ.lower()}
        assert all(word in KNOWN or (before and word.isdigit()) for word in told), name
        assert label_named(name) == organ.lower() or any(name in note for note in notes)


def test_the_type_is_a_second_witness() -> None:
    with pytest.raises(InputError, match=r"no plain prostate, only Prostate \(its type is PTV\)"):
        choose_rois(["Prostate"], "rs", types={"Prostate": "PTV"})
    types = {"Prostate": "PTV", "prostate gland": "ORGAN"}
    assert choose_rois(list(types), "rs", types=types) == (
        {"prostate": ["prostate gland"]},
        ["prostate is prostate gland; not used: Prostate"],
    )
    assert choose_rois(["Prostate"], "rs", types={"Prostate": "CTV"})[1] == [
        "prostate is Prostate (Prostate is CTV by its type)"
    ]
    both = {"Prostate": "GTV", "Prostata": "ORGAN"}
    assert choose_rois(list(both), "rs", types=both)[0] == {"prostate": ["Prostata"]}


def test_a_part_of_an_organ_is_told() -> None:
    assert choose_rois(["Rectum~"], "rs")[1] == ["rectum is Rectum~ (Rectum~ is by its ~ a part of it)"]
    assert choose_rois(["Rectum~", "Rektum"], "rs")[0] == {"rectum": ["Rektum"]}


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
