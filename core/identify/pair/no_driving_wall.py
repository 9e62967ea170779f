"""The answer for a pair in which the organ's surface is all that is seen: how it moves inside, and no stiffness."""

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

# On the mesh of a case linear elements are 0.1 mm off inside the organ, these a tenth of that.
ELEMENT = "p2p1"
# Whoever predicts landmarks better by less than this share does not predict them better.
_BETTER = 0.1
NEXT = "to tell it, show a wall that moved beside it (bladder, rectum, a balloon), the bone that holds it, or give a force that is known"


def surface_is_all(problem: IdentificationProblem) -> bool:
    """Whether nothing beside the organ is seen: no wall that drives it and no bone that holds it."""
    return not problem.walls and "bone" not in problem.boundary


def moved_by_its_surface(problem: IdentificationProblem) -> NoInformation:
    """Prescribe the organ's surface, predict its inside. Raises ConvergenceError when the surfaces cannot be matched."""
    organ, vertices = problem.mesh.submesh(problem.regions)
    space = Space.of(organ, ELEMENT)
    found = explain_surface(space, organ.boundary[0], problem.organ, problem.landmarks)
    points, _, region, _ = sample_surface(problem.organ.rest, SURFACE_MM)
    whole = np.zeros_like(problem.mesh.points)
    whole[vertices] = found.u[: len(vertices)]  # mid-edge nodes follow the vertices
    return NoInformation(
        in_words=reason(len(problem.regions)),
        mesh_displacement=whole,
        points=points,
        region=region,
        displacement=space.interpolation(points) @ found.u,
        expected_mm=float(np.hypot(np.sqrt(2.0) * problem.facts.noise_sd_mm, EXTRACTION_MM)),
        notes=(NEXT, *landmark_words(found)),
        landmarks=landmark_figures(found),
        surface_mm={way: round(value, 3) for way, value in found.surface_mm.items()},
    )


def reason(regions: int) -> str:
    """Why the organ's surface alone tells no stiffness."""
    if regions == 1:
        return (
            "the organ's surface is all that is seen; any stiffness takes this shape under pressures in proportion to it, and "
            "no pressure is known; left and right are not divided, so that no part can be told from another either"
        )
    return (
        "the organ's surface is all that is seen; any stiffness of its parts takes this shape under pressures that suit it, and "
        "no pressure is known"
    )


def landmark_figures(found: SurfaceAlone) -> dict[str, LandmarkRecord] | None:
    """Distances of the landmarks, mm, by way of moving them; None without landmarks."""
    if not found.landmarks_mm:
        return None
    return {
        way: LandmarkRecord([round(float(d), 3) for d in distances], round(rms(distances), 3))
        for way, distances in found.landmarks_mm.items()
    }


def landmark_words(found: SurfaceAlone) -> tuple[str, ...]:
    """What the landmarks say of the model, in one line; none without landmarks."""
    if not found.landmarks_mm:
        return ()
    left = {way: rms(found.landmarks_mm[way]) for way in WAYS}
    count = len(found.landmarks_mm["model"])
    figures = (
        f"{count} landmarks lie {left['still']:.2f} mm rms from where the deformed state shows them with both in one frame, "
        f"{left['rigid']:.2f} after the best rigid motion of the surface, {left['affine']:.2f} after the best affine one and "
        f"{left['model']:.2f} where a uniform body takes them"
    )
    others = min(left["rigid"], left["affine"])
    if left["model"] < (1.0 - _BETTER) * others:
        return (f"{figures}: mechanics predicts them better than a motion without, by {others - left['model']:.2f} mm",)
    return (f"{figures}: mechanics predicts them no better than a motion without",)
