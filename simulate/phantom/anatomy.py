"""The solids of the phantom's male pelvis, mm about the prostate: +x patient left, +y posterior, +z superior.

Left and right differ everywhere on purpose, so that a mirrored picture or result is noticed.
"""

from __future__ import annotations

from palpate.simulate.phantom.solids import Capsule, Ellipsoid, Solid, Trunk, Tube
from palpate.simulate.phantom.unions import Cut, Shrunk, Union, Without

SKIN_MM = 1.8
CORTEX_MM = 2.4
BLADDER_WALL_MM = 3.0
RECTUM_WALL_MM = 3.2

BODY = Trunk((2.0, 6.0), left=171.0, right=166.0, front=103.0, back=111.0)
MUSCLE = Trunk((2.0, 4.0), left=151.0, right=149.0, front=80.0, back=84.0, power=2.6)
TABLE = Without(
    Ellipsoid((0.0, 146.0, 0.0), (215.0, 26.0, 1e5), 4.0), Ellipsoid((0.0, 146.0, 0.0), (213.0, 24.0, 1e5), 4.0)
)

# The bony pelvis' inside, and the fossae beside the anal canal, are filled with fat.
PELVIC_FAT: tuple[Solid, ...] = (
    Union(
        (Ellipsoid((1.0, 9.0, 8.0), (46.0, 64.0, 40.0), 2.5), Ellipsoid((2.0, 10.0, 48.0), (66.0, 72.0, 60.0), 2.5)),
        12.0,
    ),
    Ellipsoid((27.0, 44.0, -44.0), (24.0, 26.0, 34.0)),
    Ellipsoid((-25.0, 43.0, -42.0), (23.0, 25.0, 33.0)),
)
# Fat between the muscles of the hip.
MUSCLE_FAT: tuple[Solid, ...] = (
    Without(Ellipsoid((112.0, -2.0, 6.0), (42.0, 46.0, 120.0)), Ellipsoid((112.0, -2.0, 6.0), (38.0, 42.0, 118.0))),
    Without(Ellipsoid((-109.0, 0.0, 2.0), (41.0, 47.0, 120.0)), Ellipsoid((-109.0, 0.0, 2.0), (37.5, 43.0, 118.0))),
    Ellipsoid((72.0, -62.0, 0.0), (15.0, 13.0, 90.0)),
    Ellipsoid((-70.0, -60.0, -4.0), (14.0, 14.0, 90.0)),
)
# The levator ani is a sheet on both sides of the prostate, open in front and behind.
_LEVATOR = Without(Ellipsoid((1.5, 6.0, 14.0), (38.0, 60.0, 50.0)), Ellipsoid((1.5, 6.0, 14.0), (35.0, 58.0, 47.0)))
LEVATOR: Solid = Cut(
    Cut(Cut(_LEVATOR, (0.0, 0.0, 12.0), (0.1, 0.0, 1.0)), (0.0, -24.0, 0.0), (0.0, -1.0, 0.0)),
    (0.0, 44.0, 0.0),
    (0.0, 1.0, 0.2),
)
PELVIC_MUSCLE: tuple[Solid, ...] = (
    # Obturator internus, right somewhat thicker, and the muscles of the perineum in front of the anal canal.
    Ellipsoid((51.0, 4.0, -4.0), (9.5, 34.0, 36.0), 2.6),
    Ellipsoid((-50.5, 5.0, -6.0), (11.0, 33.0, 37.0), 2.6),
    Ellipsoid((0.5, -10.0, -46.0), (36.0, 26.0, 16.0), 2.4),
    # Piriformis and coccygeus, towards the sacrum.
    Capsule((52.0, 40.0, 34.0), (20.0, 74.0, 32.0), 9.0, 7.0),
    Capsule((-51.0, 42.0, 32.0), (-20.0, 74.0, 31.0), 9.0, 7.5),
    LEVATOR,
)
VESSELS: tuple[Solid, ...] = (
    Capsule((62.0, -30.0, 90.0), (70.0, -66.0, -90.0), 5.5),
    Capsule((-60.0, -32.0, 90.0), (-69.0, -64.0, -90.0), 5.0),
    Capsule((54.0, -20.0, 90.0), (62.0, -58.0, -90.0), 6.5),
    Capsule((-53.0, -22.0, 90.0), (-60.0, -56.0, -90.0), 7.0),
    Capsule((36.0, 30.0, 44.0), (34.0, 26.0, -20.0), 1.6),
    Capsule((-35.0, 31.0, 46.0), (-34.0, 25.0, -24.0), 1.6),
)


def _side(s: float, head: tuple[float, float, float], head_radius: float, tilt: float) -> tuple[Solid, ...]:
    """Hip bone and femur of one side, s = +1 left or -1 right; each solid has its own cortex."""
    x, y, z = head
    socket = Ellipsoid((s * x, y, z), (head_radius + 12.0, head_radius + 10.0, head_radius + 12.0))
    gap = Ellipsoid((s * x, y, z), (head_radius + 3.0,) * 3)
    acetabulum = Cut(Without(socket, gap), (s * (x + 8.0), y, z), (s, 0.1, -0.45))
    column = Capsule((s * (x - 12.0), y + 26.0, z + 8.0), (s * (x - 4.0), y + 34.0, z + 85.0), 13.0, 20.0)
    ischium = Capsule((s * (x - 14.0), y + 26.0, z - 12.0), (s * (x - 29.0), y + 25.0, z - 66.0), 11.0, 14.0)
    femur = Union(
        (
            Ellipsoid((s * x, y, z), (head_radius,) * 3),
            Capsule((s * x, y, z), (s * (x + 32.0), y + 8.0, z - 28.0 - tilt), 14.0, 15.5),
            Ellipsoid((s * (x + 39.0), y + 12.0, z - 22.0 - tilt), (12.0, 17.0, 22.0)),
            Capsule((s * (x + 33.0), y + 8.0, z - 36.0 - tilt), (s * (x + 28.0), y + 2.0, z - 130.0), 17.0, 13.5),
        ),
        6.0,
    )
    return Union((acetabulum, column, ischium), 4.0), femur


PUBIS: Solid = Union(
    (
        Ellipsoid((9.5, -41.0, -10.0), (7.6, 9.0, 19.0)),
        Ellipsoid((-8.5, -40.5, -9.0), (7.6, 9.0, 18.0)),
        Capsule((12.0, -42.0, 0.0), (66.0, -24.0, 20.0), 8.0, 9.5),
        Capsule((-11.0, -41.5, 1.0), (-64.0, -22.0, 18.0), 8.5, 9.0),
        Capsule((11.0, -37.0, -22.0), (57.0, 10.0, -49.0), 6.5, 7.5),
        Capsule((-10.0, -36.0, -21.0), (-55.0, 11.0, -50.0), 6.5, 8.0),
    ),
    3.0,
)
SACRUM: Solid = Union(
    (
        Capsule((1.0, 77.0, 12.0), (2.0, 82.0, 24.0), 5.0, 6.5),
        Capsule((2.0, 83.0, 27.0), (3.0, 92.0, 50.0), 9.0, 13.0),
        Ellipsoid((3.0, 96.0, 72.0), (42.0, 15.0, 34.0)),
    ),
    5.0,
)
BONES: tuple[Solid, ...] = (
    PUBIS,
    SACRUM,
    *_side(1.0, (89.0, -8.0, 21.0), 24.5, 0.0),
    *_side(-1.0, (86.0, -6.0, 18.0), 23.0, 5.0),
)

BLADDER: Solid = Union(
    (Ellipsoid((4.0, -8.0, 54.0), (41.0, 34.0, 21.5), 2.2), Ellipsoid((-12.0, -4.0, 51.0), (27.0, 28.0, 17.0))), 6.0
)
RECTUM = Tube(
    (
        (-90.0, 2.0, 60.0, 11.0, 10.0),
        (-60.0, 1.5, 48.0, 12.0, 11.0),
        (-36.0, 0.0, 44.0, 16.0, 13.0),
        (-12.0, -2.0, 45.5, 20.0, 15.0),
        (10.0, -2.5, 47.5, 21.0, 16.0),
        (34.0, 2.0, 52.0, 20.0, 16.0),
        (60.0, 9.0, 58.5, 18.5, 16.0),
        (90.0, 18.0, 60.0, 19.0, 16.0),
    )
)
# A large gland, as most men who are scanned for it have: its size is what a change of its shape can be read from.
PROSTATE: Solid = Union(
    (
        Ellipsoid((10.0, 0.5, 0.5), (19.8, 20.6, 25.6), 2.2),
        Ellipsoid((-8.3, -0.5, -1.5), (18.2, 18.8, 23.8), 2.2),
    ),
    10.0,
)
URINE: Solid = Shrunk(BLADDER, BLADDER_WALL_MM)
RECTAL_LUMEN: Solid = Shrunk(RECTUM, RECTUM_WALL_MM)
