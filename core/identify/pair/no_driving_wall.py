"""Result for a pair that shows only the organ's surface: its inner motion, without a stiffness."""

from __future__ import annotations

import numpy as np

from palpate.core.fem.space import Space
from palpate.core.identify.pair.no_information import SURFACE_MM, NoInformation
from palpate.core.identify.pair.surface_only import WAYS, SurfaceAlone, explain_surface
from palpate.core.identify.result_record import LandmarkRecord
from palpate.core.observe.contour_noise import EXTRACTION_MM
from palpate.core.observe.surface_observation import sample_surface
from palpate.core.problem import IdentificationProblem
from palpate.core.statistics import rms

# Element of the uniform body. On the mesh of a case its error inside the organ is 0.01 mm, that of linear elements 0.1 mm.
ELEMENT = "p2p1"
# Smallest relative reduction of the landmark distance that counts as a better prediction.
_BETTER = 0.1
NEXT = "to tell it, show a wall that moved beside it (bladder, rectum, a balloon), the bone that holds it, or give a force that is known"


def surface_is_all(problem: IdentificationProblem) -> bool:
    """Whether the problem has neither a driving wall nor a bone that holds the organ."""
    return not problem.walls and "bone" not in problem.boundary


def moved_by_its_surface(problem: IdentificationProblem) -> NoInformation:
    """Inner motion of the organ under its prescribed surface motion. Raises ConvergenceError when the surfaces cannot
    be matched.
    """
    organ, vertices = problem.mesh.submesh(problem.regions)
    space = Space.of(organ, ELEMENT)
    motion = explain_surface(space, organ.boundary[0], problem.organ, problem.landmarks)
    points, _, region, _ = sample_surface(problem.organ.rest, SURFACE_MM)
    whole = np.zeros_like(problem.mesh.points)
    whole[vertices] = motion.u[: len(vertices)]  # mid-edge nodes follow the vertices
    return NoInformation(
        in_words=reason(len(problem.regions)),
        mesh_displacement=whole,
        points=points,
        region=region,
        displacement=space.interpolation(points) @ motion.u,
        expected_mm=float(np.hypot(np.sqrt(2.0) * problem.organ_noise_mm, EXTRACTION_MM)),
        notes=(NEXT, *landmark_words(motion)),
        landmarks=landmark_figures(motion),
        surface_mm={way: round(value, 3) for way, value in motion.surface_mm.items()},
    )


def reason(regions: int) -> str:
    """Reason why the organ's surface alone does not identify a stiffness."""
    if regions == 1:
        return (
            "the organ's surface is all that is seen; any stiffness takes this shape under pressures in proportion to it, and "
            "no pressure is known; left and right are not divided, so that no part can be told from another either"
        )
    return (
        "the organ's surface is all that is seen; any stiffness of its parts takes this shape under pressures that suit it, and "
        "no pressure is known"
    )


def landmark_figures(motion: SurfaceAlone) -> dict[str, LandmarkRecord] | None:
    """Distances of the landmarks, mm, by motion model; None without landmarks."""
    if not motion.landmarks_mm:
        return None
    return {
        way: LandmarkRecord([round(float(d), 3) for d in distances], round(rms(distances), 3))
        for way, distances in motion.landmarks_mm.items()
    }


def landmark_words(motion: SurfaceAlone) -> tuple[str, ...]:
    """Comparison of the motion models by their landmark distances, in one line; empty without landmarks."""
    if not motion.landmarks_mm:
        return ()
    rms_mm = {way: rms(motion.landmarks_mm[way]) for way in WAYS}
    count = len(motion.landmarks_mm["model"])
    figures = (
        f"{count} landmarks lie {rms_mm['still']:.2f} mm rms from where the deformed state shows them with both in one frame, "
        f"{rms_mm['rigid']:.2f} after the best rigid motion of the surface, {rms_mm['affine']:.2f} after the best affine one and "
        f"{rms_mm['model']:.2f} where a uniform body takes them"
    )
    others = min(rms_mm["rigid"], rms_mm["affine"])
    if rms_mm["model"] < (1.0 - _BETTER) * others:
        return (
            f"{figures}: mechanics predicts them better than a motion without, by {others - rms_mm['model']:.2f} mm",
        )
    return (f"{figures}: mechanics predicts them no better than a motion without",)
