"""The diagnosis's noise model against cases without an effect: ``python tests/benchmarks/gap_noise.py CASE ...``.

Each CASE is a case folder, meshed or not, in which nothing is hidden (of `palpate validate gap --folder F`, those whose answer
says "none"). Printed are the log restricted likelihoods of their residuals together, each less that of the sizes in use, as one size after
another is changed: none should be above 0 by more than chance. A change of 2 is about two standard deviations of one size.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from palpate.case.case_data import data_of
from palpate.case.case_folder import CaseFolder
from palpate.case.steps import mesh
from palpate.core.arrays import FloatArray
from palpate.core.inference.restricted_likelihood import restricted
from palpate.core.observe.wall_motion import WallMotion
from palpate.core.residual.noise_covariance import NoiseParts, NoiseSizes
from palpate.core.residual.plain_fit import PlainFit, fit_plain
from palpate.core.residual.unknown_field import UnknownDiscrepancy
from palpate.core.worker.executors import one_thread

SLIDES = (0.0, 0.1, 0.15, 0.2, 0.3, 0.4)
SIZES: dict[str, tuple[float, ...]] = {
    "mesh": (0.0, 0.3, 0.45, 0.6, 1.0),
    "offset": (0.0, 0.03, 0.1, 0.2, 0.3),
    "model": (0.0, 0.1, 0.2, 0.3, 0.4),
}


def main() -> None:
    """Prints one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="+", type=Path)
    args = parser.parse_args()
    one_thread()
    total: dict[str, FloatArray] = {}
    for path in args.cases:
        for name, logs in likelihoods(plain_of(path)).items():
            total[name] = total.get(name, np.zeros(len(logs))) + logs
    of = {"slides": SLIDES} | SIZES
    print(json.dumps({k: dict(zip(map(str, of[k]), v.round(2).tolist(), strict=True)) for k, v in total.items()}))


def plain_of(path: Path) -> PlainFit:
    """The plain model of a copy of the case."""
    with tempfile.TemporaryDirectory() as folder:
        lone = shutil.copytree(path, Path(folder) / path.name, copy_function=shutil.copyfile)
        lone.chmod(0o755)
        case = CaseFolder(lone)
        if not case.has("mesh.json"):
            mesh.run(case)
        data = data_of(case)
    return fit_plain(data.pairs)


def likelihoods(fit: PlainFit) -> dict[str, FloatArray]:
    """For each size, log likelihoods as it changes, less that of the sizes in use."""
    forces = UnknownDiscrepancy.around(fit.linearisation, fit.model.data_vectors, fit.options).response
    used = NoiseSizes.of(fit.options)
    parts = _parts(fit)
    base = _log_likelihood(fit, parts, used, forces)
    out = {
        name: np.array([_log_likelihood(fit, parts, replace(used, **{name: v}), forces) - base for v in values])
        for name, values in SIZES.items()
    }
    return out | {"slides": _slides(fit, used, forces) - base}


def _slides(fit: PlainFit, used: NoiseSizes, forces: FloatArray) -> FloatArray:
    """The walls' likeliest motions stay as they are: slides change only what is unknown of them."""
    stages = [point.scene.geometry for point in fit.linearisation.each]
    kept, logs = [dict(geometry.motions) for geometry in stages], []
    for share in SLIDES:
        for geometry, motions in zip(stages, kept, strict=True):
            geometry.motions |= {name: _sliding(motion, share) for name, motion in motions.items()}
        logs.append(_log_likelihood(fit, _parts(fit), used, forces))
    for geometry, motions in zip(stages, kept, strict=True):
        geometry.motions |= motions
    return np.array(logs)


def _sliding(motion: WallMotion, share: float) -> WallMotion:
    options = replace(motion.options, slide_share=share)
    return replace(motion, rigid=replace(motion.rigid, options=options))


def _parts(fit: PlainFit) -> NoiseParts:
    return NoiseParts.of(fit.linearisation.each, fit.model.data_vectors, fit.options)


def _log_likelihood(fit: PlainFit, parts: NoiseParts, sizes: NoiseSizes, forces: FloatArray) -> float:
    """Of the residual, at what the case's own data make of the noise."""
    left = np.hstack([sizes.mesh * fit.model.correction.value[:, None], sizes.model * forces])
    own = replace(fit.sizes, mesh=sizes.mesh, offset=sizes.offset, model=sizes.model)
    return restricted(parts.covariance(own, left), fit.linearisation.residual, fit.linearisation.in_theta)


if __name__ == "__main__":
    main()
