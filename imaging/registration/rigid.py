"""Rigid registration of two pictures of bone: over all shifts first, then finely on grey values."""

from __future__ import annotations

import numpy as np
import SimpleITK as sitk

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.imaging.registration.bone_surface import BoneField

COARSE_MM = 6.0
# Of the largest possible overlap: below, chance likeness of small corners wins.
COARSE_OVERLAP = 0.4
# Voxels that the metric looks at on each level, about.
SAMPLES = 40_000
SHRINK = (4, 2, 1)


def coarse_shift(rest: BoneField, deformed: BoneField) -> sitk.Transform:
    """The translation, rest point to deformed point, at which coarse pictures of the bone look most alike.

    Correlation by FFT over all shifts, normalised by what both scans cover (Padfield 2012), so that a scan of a part
    is found in one of the whole.
    """
    fixed, moving = _coarse(rest.mask), _coarse(deformed.mask)
    covered = [_from_zero(sitk.Cast(image > -1.0, sitk.sitkFloat32)) for image in (fixed, moving)]
    score = sitk.MaskedFFTNormalizedCorrelation(
        _from_zero(fixed),
        _from_zero(moving),
        covered[0],
        covered[1],
        requiredFractionOfOverlappingPixels=COARSE_OVERLAP,
    )
    array = sitk.GetArrayViewFromImage(score)
    peak = np.array(np.unravel_index(int(np.argmax(array)), array.shape))[::-1] - (np.array(moving.GetSize()) - 1)
    return sitk.TranslationTransform(
        3, (np.array(moving.GetOrigin()) - np.array(fixed.GetOrigin()) - peak * COARSE_MM).tolist()
    )


def _coarse(mask: sitk.Image) -> sitk.Image:
    """The share of bone on a grid along the patient's axes."""
    size = np.array(mask.GetSize()) - 1
    corners = [
        mask.TransformIndexToPhysicalPoint([int(c) for c in size * np.array(bits)]) for bits in np.ndindex(2, 2, 2)
    ]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    smooth = sitk.SmoothingRecursiveGaussian(sitk.Cast(mask, sitk.sitkFloat32), [COARSE_MM / 2] * 3)
    shape = [int(n) for n in np.ceil((high - low) / COARSE_MM) + 1]
    return sitk.Resample(
        smooth, shape, sitk.Transform(), sitk.sitkLinear, low.tolist(), [COARSE_MM] * 3, np.eye(3).ravel().tolist(), 0.0
    )


def _from_zero(image: sitk.Image) -> sitk.Image:
    """The same pixels placed at the origin: the correlation wants both images in one place."""
    placed = sitk.Image(image)
    placed.SetOrigin([0.0] * 3)
    return placed


def register(rest: BoneField, deformed: BoneField, mask: sitk.Image, start: sitk.Transform) -> sitk.Euler3DTransform:
    """Refines a rigid transform, rest point to deformed point, on the bone's grey values inside ``mask``."""
    method = sitk.ImageRegistrationMethod()
    # One thread: sums in one order, so one answer on every machine.
    method.SetNumberOfThreads(1)
    method.SetMetricAsMeanSquares()
    method.SetMetricFixedMask(mask)
    method.SetMetricSamplingStrategy(method.REGULAR)
    inside = float(sitk.GetArrayViewFromImage(mask).sum())
    shares = [min(1.0, SAMPLES * shrink**3 / inside) for shrink in SHRINK]
    method.SetMetricSamplingPercentagePerLevel(shares, 1)
    method.SetInterpolator(sitk.sitkLinear)
    method.SetShrinkFactorsPerLevel(SHRINK)
    method.SetSmoothingSigmasPerLevel([4.0, 2.0, 0.0])
    method.SetOptimizerAsRegularStepGradientDescent(2.0, 1e-3, 200, 0.7, 1e-8)
    method.SetOptimizerScalesFromPhysicalShift()
    transform = _as_rigid(start, mask)
    method.SetInitialTransform(transform, inPlace=True)
    try:
        method.Execute(rest.field, deformed.field)
    except RuntimeError as error:
        raise InputError(
            "the two scans show no common bone; give two scans of the same region of one patient"
        ) from error
    return transform


def _as_rigid(start: sitk.Transform, mask: sitk.Image) -> sitk.Euler3DTransform:
    rigid = sitk.Euler3DTransform(start) if start.GetName() == "Euler3DTransform" else sitk.Euler3DTransform()
    if start.GetName() != "Euler3DTransform":
        statistics = sitk.LabelShapeStatisticsImageFilter()
        statistics.Execute(mask)
        rigid.SetCenter(statistics.GetCentroid(1))
        rigid.SetTranslation(sitk.TranslationTransform(start).GetOffset())
    return rigid


def reach(mask: sitk.Image, distance: float) -> sitk.Image:
    """The mask grown by ``distance`` mm."""
    return sitk.BinaryDilate(mask, [max(1, round(distance / spacing)) for spacing in mask.GetSpacing()])


def matrix_of(transform: sitk.Euler3DTransform) -> FloatArray:
    """The (4, 4) of a rigid transform, LPS mm."""
    matrix: FloatArray = np.eye(4)
    matrix[:3, :3] = np.array(transform.GetMatrix()).reshape(3, 3)
    centre = np.array(transform.GetCenter())
    matrix[:3, 3] = centre + np.array(transform.GetTranslation()) - matrix[:3, :3] @ centre
    return matrix
