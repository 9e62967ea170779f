"""The paper's studies as `palpate validate` runs, tells and draws them."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from palpate.core.worker.progress import Progress
from palpate.ui.cli.arguments import random_seed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def tables(args: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    """Table 1 or 2, by the study's name."""
    from palpate.core.validate import tumour_tables

    o = tumour_tables.TableOptions
    options = o.quick(random_seed(args)) if args.quick else o(seed=random_seed(args))
    return {"table1": tumour_tables.table1, "table2": tumour_tables.table2}[args.study](options, progress)


def tables_text(found: dict[str, Any]) -> str:
    """One line a column of the paper's table."""
    lines = [
        "mu in kPa, the tumour's half and the normal half",
        f"{found['by']:>14}   has          same surface  found         of has    noisy, 95 % interval       paper",
    ]
    for row in found["rows"]:
        clean, noisy, paper = row["clean"]["mu_kpa"], row["noisy"], row["paper"]
        low, high = noisy["ci95_kpa"][0]
        lines.append(
            f"{row[found['by']]:14.3g}   {_pair(row['effective_mu_kpa'])} {_pair(row['same_surface_mu_kpa'])} {_pair(clean)} "
            f"{row['error_percent'][0]:+6.1f} %   {_pair(noisy['mu_kpa'])} ({low:.3g} to {high:.3g})   "
            f"{paper['tumour']:.4g} {paper['normal']:.4g}"
        )
    correlation = found["correlation"]
    lines.append(
        f"correlation {correlation['clean']:.4f} without noise, {correlation['noisy']:.4f} with {found['noise_sd_mm']:g} mm; "
        f"the paper's {found['paper_correlation']}"
    )
    lines.append(f"normal half off by at most {found['largest_normal_error_percent']:.1f} % without noise")
    return "\n".join(lines)


def tables_picture(found: dict[str, Any]) -> Figure:
    """See `ui.pictures.study_tables`."""
    from palpate.ui.pictures.study_tables import study_table

    return study_table(found)


def _pair(values: Any) -> str:
    return f"{values[0]:6.4g} {values[1]:6.4g}"
