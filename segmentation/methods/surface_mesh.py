"""Closed triangle surfaces while an organ is being drawn: normals, neighbours, samples along normals, voxels inside."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyvista as pv
from scipy import ndimage
from scipy.sparse import coo_array, csr_array, diags_array
from skimage.measure import marching_cubes
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkImagingStencil import vtkImageStencilToImage, vtkPolyDataToImageStencil

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.surfaces.triangles import enclosed_volume, point_normals
from palpate.imaging.volume import Volume
from palpate.segmentation.working_grid import Mask

# What a shell keeps that depends on its triangles alone.
_OF_FACES = ("edges", "mean_of_neighbours")


@dataclass(frozen=True, eq=False)
class Shell:
    """points : (n, 3) mm LPS. faces : (f, 3) indices, wound so that normals point outward."""

    points: FloatArray
    faces: IntArray

    def moved(self, points: FloatArray) -> Shell:
        """The same triangles at other points (n, 3) mm; who is whose neighbour is not sought again."""
        out = Shell(points, self.faces)
        out.__dict__.update({name: self.__dict__[name] for name in _OF_FACES if name in self.__dict__})
        return out

    @cached_property
    def edges(self) -> IntArray:
        """Neighbouring points (e, 2), each pair once."""
        pairs = np.concatenate([self.faces[:, [0, 1]], self.faces[:, [1, 2]], self.faces[:, [2, 0]]])
        n = len(self.points)
        # One number a pair: sorted four times as fast as rows.
        numbers = np.unique(pairs.min(axis=1) * n + pairs.max(axis=1))
        return np.stack([numbers // n, numbers % n], axis=1)

    @cached_property
    def normals(self) -> FloatArray:
        """Unit outward normals (n, 3)."""
        return point_normals(self.points, self.faces)

    @cached_property
    def mean_of_neighbours(self) -> csr_array:
        """Matrix (n, n) that takes values at points to the mean over each point's neighbours."""
        n, e = len(self.points), self.edges
        link = csr_array(coo_array((np.ones(len(e)), (e[:, 0], e[:, 1])), shape=(n, n)))
        link = link + link.T
        count = np.maximum(np.asarray(link.sum(axis=1)).ravel(), 1.0)
        return csr_array(diags_array(1.0 / count) @ link)

    def smoothed(self, values: FloatArray, rounds: int, weight: FloatArray | None = None) -> FloatArray:
        """Values (n,) drawn towards their neighbours, by turns in and out so that nothing shrinks (Taubin 1995).

        weight : (n,) 0 keeps a value, 1 lets it move; all may move where None.
        """
        move = np.ones(len(self.points)) if weight is None else weight
        move = move if values.ndim == 1 else move[:, None]
        for factor in [0.5, -0.52] * rounds:
            values = values + factor * move * (self.mean_of_neighbours @ values - values)
        return values

    def voxels(self, grid: Volume) -> Mask:
        """Which voxel centres of an upright even grid lie inside."""
        stencil = vtkPolyDataToImageStencil()
        stencil.SetInputData(pv.PolyData(self.points, np.insert(self.faces, 0, 3, axis=1).ravel()))
        stencil.SetOutputOrigin(*grid.affine[:3, 3])
        stencil.SetOutputSpacing(*grid.spacing)
        shape = grid.array.shape
        stencil.SetOutputWholeExtent(0, shape[0] - 1, 0, shape[1] - 1, 0, shape[2] - 1)
        image = vtkImageStencilToImage()
        image.SetInputConnection(stencil.GetOutputPort())
        image.SetInsideValue(1)
        image.SetOutsideValue(0)
        image.SetOutputScalarTypeToUnsignedChar()
        image.Update()
        flat = vtk_to_numpy(image.GetOutput().GetPointData().GetScalars())
        return np.asarray(np.transpose(flat.reshape(shape[::-1])) > 0)


def shell_of_mask(mask: Mask, grid: Volume, sigma_mm: float) -> Shell:
    """Smooth surface of a mask on an upright grid; closed where the mask meets the grid's end."""
    pad = 3
    soft = ndimage.gaussian_filter(np.pad(mask, pad).astype(np.float32), sigma_mm / grid.spacing)
    index, faces, _, _ = marching_cubes(soft, 0.5, gradient_direction="descent")
    shell = Shell(grid.to_lps(index.astype(float) - pad), faces.astype(np.int64))
    return (
        shell
        if enclosed_volume(shell.points, shell.faces) > 0.0
        else Shell(shell.points, np.ascontiguousarray(shell.faces[:, ::-1]))
    )


def profiles(image: Volume, points: FloatArray, directions: FloatArray, offsets: FloatArray) -> FloatArray:
    """Values (n, m) of an image at points (n, 3) + offsets (m,) mm along directions (n, 3); linear, nearest beyond the grid."""
    at = points[:, None, :] + offsets[None, :, None] * directions[:, None, :]
    return image.at(at.reshape(-1, 3)).reshape(len(points), len(offsets))
