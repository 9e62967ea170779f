"""Words that name an organ, a side, or something made from an organ, in the languages that contours are named in.

Sources: TG-263 (AAPM, 2018), TotalSegmentator's class names, 3D Slicer's terminology (SNOMED CT), and the plain words of English,
German, French, Spanish, Italian, Portuguese, Dutch, some Latin and Scandinavian. Lower case, without accents.
"""

from __future__ import annotations


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


ORGAN_WORDS: dict[str, frozenset[str]] = {
    "prostate": _words(
        "prostate prostata prostatica prostatique prostatic prostat prostaat prost prostatadruse vorsteherdruse voorstanderklier"
    ),
    "bladder": _words(
        "bladder blad blase harnblase vessie vejiga vescica bexiga blaas urineblaas vesica urinblasa urinblaere blaere bladdar"
    ),
    "rectum": _words(
        "rectum rektum rect recto retto reto enddarm mastdarm endeldarm anorectum anorektum rectoanal anoretto andtarm endetarm"
    ),
    "bone": _words(
        "femur femurs femora femoral femore femori femorale femorali femorales femoraux femoralis femoris femural fem femurkopf "
        "femurkopfe femurkop femkopf femhead huftkopf huftkopfe hueftkopf oberschenkelkopf oberschenkelknochen schenkelkopf "
        "heupkop dijbeen dijbeenkop bone bones osso ossa ossos knochen bot botten hueso huesos "
        "sacrum sacro kreuzbein heiligbeen pubis pube schambein schaambeen ischium ischio isquion sitzbein zitbeen "
        "ilium iliaco ilion darmbein acetabulum acetabolo acetabulo coxal coxae innominate pelvis bacino becken "
        "beckenknochen bekken bassin bacia huftbein huftknochen huftgelenk hufte heup hip hips hanche hanches cadera caderas "
        "quadril anca anche coccyx coccige coxis steissbein staartbeen vertebra vertebrae vertebre vertebras wirbel"
    ),
    "surrounding_tissue": frozenset({"surroundingtissue"}),
}
# Words that may stand beside an organ's without changing what is meant.
NEUTRAL_WORDS = _words(
    "gland glandula ghiandola druse klier glande urinary urinaria urinaire urinario urinarius urin harn the of di de del della do da "
    "des du la le il el der die das van organ organo organe oar contour manual manuale manuell roi structure entire whole "
    "total totale gesamt ganz complete intera"
)
# Beside bone only: elsewhere a neck or a head is a part of the organ.
NEUTRAL_BESIDE_BONE = _words(
    "head heads testa teste kopf tete tetes cabeza cabezas cabeca cabecas caput kop koppen neck collo hals col cuello colo collum "
    "headneck joint gelenk articolazione pelvic pelvico sacral pubic"
)
# The anus goes with the rectum in many contours; a rectum alone goes before one with it.
BESIDE_RECTUM = _words("anus ano anal anale canal canale kanal kanaal ampulla ampolla ampulle")

# Who or what drew a contour, and how far it has come.
DRAWN_BY = _words("dl mbs ai auto autoseg autosegmented autocontour final approved clinical edited corrected reviewed")

# Types of a structure (RTROIInterpretedType, DICOM PS3.3 C.8.8.8) that no organ has.
NO_ORGAN_TYPES = _words(
    "PTV BOLUS CAVITY CONTRAST_AGENT CONTROL DOSE_MEASUREMENT DOSE_REGION EXTERNAL FIDUCIAL FIXATION IRRAD_VOLUME ISOCENTER "
    "MARKER REGISTRATION SUPPORT TREATED_VOLUME BRACHY_ACC_DEV BRACHY_CHANNEL BRACHY_CHNL_SHLD BRACHY_SRC_APP"
)

LEFT = _words(
    "left l lt li links linker linke sinistra sinistro sin sx gauche g izquierda izquierdo izq esquerda esquerdo esq"
)
RIGHT = _words(
    "right r rt re rechts rechter rechte destra destro dx droite droit d derecha derecho der direita direito dir"
)

# Volumes made from an organ with a margin or without a part, parts of it, and things in or beside it: never the organ itself.
DERIVED_WORDS = _words(
    "ptv ctv gtv itv prv ring dose opt avoid avoidance minus plus wall walls parete wand paroi pared parede "
    "bed loggia loge lodge fossa vesicles vesicle seminal seminali seminales seminalis samenblasen samenblase sv vs vvss "
    "boost margin margine not sub hot cold exp expanded ext crop cropped overlap intersection shell partial "
    "artery arteries arteria arterie vein veins vena venous vessel vessels vasi nerve nervo nerf nodes node lymph lymphatic ln "
    "linfonodi ganglios muscle muscolo musculo muskel rectus quadriceps biceps abdominal abdominis marrow renal kidney "
    "urethra uretra uretre harnrohre ureter bulb bulbo bulbe penile balloon ballon gas air filling content contents stool "
    "spacer gel mucosa fat fett grasso trigone trigono apex capsule capsula kapsel lesion lesione lasion lesao tumor tumour "
    "tumore cancer nodule zone zona tz pz dil calcification calcifications seed seeds marker markers fiducial fiducials "
    "catheter foley implant prosthesis protesi prothese protesis gall biliare biliaire biliar fellea galle gallen"
)
PARTS_OF_SOFT_ORGANS = _words("neck collo hals col cuello colo base basis")
