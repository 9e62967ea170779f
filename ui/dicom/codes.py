"""Coded concepts of the DICOM exports: SNOMED CT, UCUM, and our own scheme for what neither names."""

from __future__ import annotations

from highdicom.coding_schemes import CodingSchemeIdentificationItem
from highdicom.sr import CodedConcept
from pydicom.sr.codedict import codes

from palpate.imaging.labels import BLADDER, BONE, PROSTATE_LEFT, PROSTATE_RIGHT, RECTUM, SURROUNDING_TISSUE

SCHEME = "99PALPATE"
# Elasticity (DCM 110829) does not say which modulus, and a shear modulus is a third of Young's.
SHEAR_MODULUS = CodedConcept("G", SCHEME, "Small-strain shear modulus G")
INTERVAL_LOW = CodedConcept("CI95LOW", SCHEME, "Lower limit of the 95 % interval")
INTERVAL_HIGH = CodedConcept("CI95HIGH", SCHEME, "Upper limit of the 95 % interval")
DETERMINED = CodedConcept("TOLD", SCHEME, "Whether the scans determine this stiffness")
DETERMINED_YES = CodedConcept("TOLDYES", SCHEME, "Determined by this pair of scans")
DETERMINED_NO = CodedConcept("TOLDNO", SCHEME, "Not determined by this pair of scans")
STIFFNESS_FROM_PAIR = CodedConcept("PAIR", SCHEME, "Stiffness from two CT scans of one organ")
AREA, SQUARE_MILLIMETRE, MEAN = codes.SCT.Area, codes.UCUM.SquareMillimeter, codes.SCT.Mean
KILOPASCAL = CodedConcept("kPa", "UCUM", "kilopascal")
STANDARD_DEVIATION = codes.SCT.StandardDeviation
ANATOMY = codes.SCT.AnatomicalStructure
LEFT, RIGHT = codes.SCT.Left, codes.SCT.Right

# Label value -> category, type and side.
OF_LABEL = {
    PROSTATE_LEFT: (ANATOMY, codes.SCT.Prostate, LEFT),
    PROSTATE_RIGHT: (ANATOMY, codes.SCT.Prostate, RIGHT),
    SURROUNDING_TISSUE: (codes.SCT.Tissue, codes.SCT.SoftTissue, None),
    BONE: (ANATOMY, codes.SCT.Bone, None),
    BLADDER: (ANATOMY, codes.SCT.Bladder, None),
    RECTUM: (ANATOMY, codes.SCT.Rectum, None),
}

# Structures of an RTSTRUCT and segments of a SEG by the primary names of AAPM Task Group 263 (Mayo et al. 2018, IJROBP
# 100:1057): organ, then side. A structure that is none of the list begins with z, as that report asks.
TG263 = {
    PROSTATE_LEFT: "Prostate_L",
    PROSTATE_RIGHT: "Prostate_R",
    SURROUNDING_TISSUE: "zTissue",
    BONE: "Bone",
    BLADDER: "Bladder",
    RECTUM: "Rectum",
}


def scheme() -> CodingSchemeIdentificationItem:
    """What ``SCHEME`` is, for an object that uses it."""
    return CodingSchemeIdentificationItem(SCHEME, name="Palpate", responsible_organization="Palpate")
