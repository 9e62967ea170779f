"""The paper's studies as `palpate validate` runs, tells and draws them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from palpate.core.worker.progress import Progress
from palpate.ui.cli.arguments import random_seed, workers

if TYPE_CHECKING:
    from palpate.core.arrays import FloatArray
    from palpate.validate.coverage import CoverageTable
    from palpate.validate.paper.cohort import CohortTable
    from palpate.validate.paper.resolution import ResolutionTable
    from palpate.validate.paper.sensitivity import SensitivityTable
    from palpate.validate.paper.swarm import SwarmTable
    from palpate.validate.paper.threads import ThreadsTable
    from palpate.validate.paper.tumour_tables import TumourTable


def tables(args: argparse.Namespace, progress: Progress) -> TumourTable:
    """Table 1 or 2, by the study's name."""
    from palpate.validate.paper import tumour_tables

    o = tumour_tables.TableOptions
    options = o.quick(random_seed(args)) if args.quick else o(seed=random_seed(args))
    return {"table1": tumour_tables.table1, "table2": tumour_tables.table2}[args.study](options, progress)


def tables_text(found: TumourTable) -> str:
    """One line a column of the paper's table, and what stands in it."""
    lines = [
        "mu in kPa, of the tumour's half and the normal half",
        f"{found['by']:>14}   has          found              of has   taken as uniform  noisy, 95 % interval       paper"
        "          other answers to what it has",
    ]
    for row in found["rows"]:
        clean, noisy, paper = row["clean"]["mu_kpa"], row["noisy"], row["paper"]
        low, high = noisy["ci95_kpa"][0]
        lines.append(
            f"{row[found['by']]:14.3g}   {row['effective_mu_kpa'][0]:6.4g}     {_pair(clean)} {row['error_percent'][0]:+6.1f} "
            f"{row['error_percent'][1]:+5.1f} %   {_pair(row['taken_as_uniform_mu_kpa'])}   {_pair(noisy['mu_kpa'])} "
            f"({low:.3g} to {high:.3g})   {paper['tumour']:.4g} {paper['normal']:.4g}"
            f"   {row['energy_in_place_mu_kpa']:6.4g} {row['energy_of_its_surface_mu_kpa']:6.4g}"
        )
    correlation = found["correlation"]
    lines.append(
        f"correlation {correlation['clean']:.4f} without noise, {correlation['noisy']:.4f} with {found['noise_sd_mm']:g} mm; "
        f"the paper's {found['paper_correlation']}; {'rises' if found['rises'] else 'does not rise'} throughout"
    )
    lines.append(
        f"off by at most {found['largest_normal_error_percent']:.1f} % in the normal half, "
        f"{found['largest_tumour_error_percent']:.1f} % in the tumour's, without noise"
    )
    return "\n".join([*lines, *_TABLES_SAY])


_TABLES_SAY = (
    "has: mean stress over mean strain of the half in its place (Hill 1963), the stiffness that a uniform half would need to carry the "
    "same mean stress at the same mean strain; it needs nothing but the half itself. The normal half has 30.",
    "other answers: the uniform half with which the whole body stores the same energy; the one that stores the same energy when its "
    "surface moves as it does, which counts every wrinkle of a soft rim. They differ because a half with a tumour is not uniform.",
    "found: without taking the halves for uniform, how uneven each is being told by the data themselves where they are without noise, and "
    "a factor of four where noise hides it; taken as uniform: by weights of contours of that noise alone",
)


def _pair(values: Sequence[float] | FloatArray) -> str:
    return f"{values[0]:6.4g} {values[1]:6.4g}"


def sensitivity(args: argparse.Namespace, progress: Progress) -> SensitivityTable:
    """Fig 8."""
    from palpate.validate.paper import sensitivity as sensitivity_study

    o = sensitivity_study.SensitivityOptions
    return sensitivity_study.sensitivity(o.quick() if args.quick else o(), progress)


def sensitivity_text(found: SensitivityTable) -> str:
    """Both curves and what came out of the paper's claim."""
    from palpate.validate.paper.sensitivity import verdict

    lines = ["relative stiffness   axis ratio linear, nonlinear   slope linear, nonlinear"]
    for k, relative in enumerate(found["relative"]):
        axis, slope = ([f[name][k] for name in ("linear", "nonlinear")] for f in (found["axis_ratio"], found["slope"]))
        lines.append(f"{relative:18.3g}   {axis[0]:.4f} {axis[1]:.4f}   {slope[0]:+.4f} {slope[1]:+.4f}")
    return "\n".join([*lines, verdict(found)])


def resolution(args: argparse.Namespace, progress: Progress) -> ResolutionTable:
    """Figs 11 and 12."""
    from palpate.validate.paper import resolution as resolution_study

    o = resolution_study.ResolutionOptions
    options = o.quick(random_seed(args)) if args.quick else o(seed=random_seed(args))
    return resolution_study.resolution(options, progress)


def resolution_text(found: ResolutionTable) -> str:
    """A line a mesh and element."""
    lines = ["element  points   normal half off by % (mean, most)   tumour's half, kPa, by its tumour's share"]
    for row in found["rows"]:
        off = row["normal_error_percent"]
        values = " ".join(f"{mu:.4g}" for mu in row["tumour_mu_kpa"])
        lines.append(f"{row['element']:8} {row['nodes']:6}   {sum(off) / len(off):6.2f} {max(off):6.2f}   {values}")
    lines.append("it has: " + " ".join(f"{mu:.4g}" for mu in found["effective_mu_kpa"]))
    return "\n".join([*lines, f"the paper: {found['paper']}"])


def swarm(args: argparse.Namespace, progress: Progress) -> SwarmTable:
    """Fig 10 and the paper's workload."""
    from dataclasses import replace

    from palpate.validate.paper import swarm as swarm_study

    o = swarm_study.SwarmStudyOptions
    options = o.quick(random_seed(args)) if args.quick else o(seed=random_seed(args))
    if args.workers:
        options = replace(options, workers=args.workers)
    return swarm_study.swarm_study(options, progress)


def swarm_text(found: SwarmTable) -> str:
    """Seconds and optimum of each way."""
    by_swarm, descent, again = found["swarm"], found["gauss_newton"], found["again"]
    parts = ", ".join(f"{key.replace('_', ' ')} {value:.2f}" for key, value in by_swarm["seconds"].items())
    return "\n".join(
        [
            f"{found['cells']} cells, {found['element']}; truth {_pair(found['truth_mu_kpa'])} kPa (mu of left and right)",
            f"swarm of {by_swarm['particles']}, {by_swarm['iterations']} iterations: {_pair(by_swarm['mu_kpa'])} kPa; seconds: {parts}; "
            f"{by_swarm['full_solves']} full solves on {found['workers']} workers",
            f"Gauss-Newton from {descent['starts']} starts: {_pair(descent['mu_kpa'])} kPa; {descent['seconds']:.2f} s, "
            f"of the processor {descent['cpu_seconds']:.2f}, "
            f"{descent['full_solves']} full solves",
            f"largest difference in ln G: {found['largest_ln_G_difference']:.2g}",
            f"a new deformed surface on the same reduced model: {_pair(again['mu_kpa'])} kPa "
            f"(truth {_pair(again['truth_mu_kpa'])}); {again['seconds']:.2f} s, of the processor {again['cpu_seconds']:.2f}",
            f"the paper: up to {found['paper']['seconds'] / 3600:.0f} hours on one core",
        ]
    )


def threads(args: argparse.Namespace, progress: Progress) -> ThreadsTable:
    """Fig 14."""
    from palpate.validate.paper.threads import threads as study

    numbers = tuple(sorted({1, args.workers})) if args.workers else ()
    return study(numbers, args.quick, progress)


def cohort(args: argparse.Namespace, progress: Progress) -> CohortTable:
    """Fig 13, of a virtual cohort or of a table."""
    from dataclasses import replace

    from palpate.validate.paper import cohort as cohort_study

    if args.table is not None:
        return cohort_study.cohort_of_table(args.table)
    o = cohort_study.CohortOptions
    options = o.quick(random_seed(args)) if args.quick else o(seed=random_seed(args))
    return cohort_study.cohort(
        replace(options, patients=args.patients, workers=workers(args), cluster=args.cluster), progress
    )


def cohort_text(found: CohortTable) -> str:
    """The statistics, the paper's beside."""
    lines = [f"patients {found['patients']}, {len(found['rows'])} of them"]
    for key, s in [*found["statistics"].items(), ("the paper", found["paper"])]:
        lines.append(
            f"{key:10} Pearson {s['pearson']:.4f} (p = {s['pearson_p']:.2g}), Spearman {s['spearman']:.4f} (p = {s['spearman_p']:.2g})"
        )
    return "\n".join(lines)


def coverage(args: argparse.Namespace, progress: Progress) -> CoverageTable:
    """Do the intervals hold the truth?"""
    from palpate.validate import coverage as study

    o = study.CoverageOptions
    return study.coverage(o.quick(random_seed(args)) if args.quick else o(seed=random_seed(args)), progress)


def coverage_text(found: CoverageTable) -> str:
    """A line a level of noise."""
    lines = [f"{found['replicates']} pairs each; share of 95 % intervals that contain the truth"]
    for row in found["rows"]:
        lines.append(
            f"{row['noise_sd_mm']:5g} mm {100 * row['covered']:5.1f} % (standard error "
            f"{100 * row['standard_error']:.1f}), median width of ln G {row['median_width_ln_G']:.2f}; "
            f"{row['called_not_identifiable']} called not identifiable, of these {row['of_these_spanning_what_was_allowed']} "
            "span what was allowed"
        )
    return "\n".join(lines)
