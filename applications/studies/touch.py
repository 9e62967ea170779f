"""The study of touching as `palpate validate touch` runs and tells it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from palpate.core.worker.progress import Progress
from palpate.ui.cli.arguments import random_seed

if TYPE_CHECKING:
    from palpate.applications.touch.touch_study import TouchTable


def run(args: argparse.Namespace, progress: Progress) -> TouchTable:
    """Answers to a probe: how far from the full solve, how many a second."""
    from palpate.applications.touch.touch_study import TouchOptions, touch_study

    seed = random_seed(args)
    return touch_study(TouchOptions.quick(seed) if args.quick else TouchOptions(seed=seed), progress=progress)


def text(found: TouchTable) -> str:
    """What was compared, and Hertz."""
    lines = [
        f"{found['pokes']} random pokes and pulls, {found['cells']} tetrahedra, probe of {found['probe_radius_mm']:g} mm, to "
        f"{found['deepest_mm']:g} mm: off from the full solve by at most {100 * found['largest_error']:.2g} %, "
        f"median {100 * found['median_error']:.2g} %; above its own estimate {found['error_above_estimate']} times; "
        f"{found['corrected_by_full']} corrected by a full solve",
        f"answers a second: {found['answers_per_second']:.0f} ({found['answers_per_cpu_second']:.0f} a processor second) each from rest, "
        f"{found['path_answers_per_second']:.0f} ({found['path_answers_per_cpu_second']:.0f}) along a path; "
        f"made ready in {found['setup_seconds']:.1f} s",
    ]
    lines += [
        f"ball pressed {row['depth_mm']:g} mm: {row['force_mn']:.4g} mN, Hertz {row['hertz_mn']:.4g} ({100 * row['error']:+.1f} %)"
        for row in found["hertz"]
    ]
    return "\n".join(lines)
