"""How far surfaces are said to be off beside how far they are, and a fit of it, judged on scans left out:
``python tests/benchmarks/surface_error_fit.py CT=RTSTRUCT ... [--variants 24] [--seed 3000] [--contrast]``.

Two lines an organ: the program's own errors as they are, then a fit to these variants. The phantom is always among the scans.
Variants are drawn as `palpate validate segmentation --variants` draws them, without medium in the bladder unless asked for.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from surface_error_model import as_it_is, held_out, judged_surfaces

from palpate.core.errors import PalpateError
from palpate.core.worker.executors import one_thread
from palpate.segmentation.error_estimate import error_models
from palpate.validate.segmentation.contoured_scan import contoured_scan, phantom_scan
from palpate.validate.segmentation.variants import drawn_recipe, variant_of


def main() -> None:
    """Prints two JSON objects an organ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", nargs="+", metavar="CT=RTSTRUCT")
    parser.add_argument("--variants", type=int, default=24)
    parser.add_argument("--seed", type=int, default=3000)
    parser.add_argument("--contrast", action="store_true")
    parser.add_argument("--modes", nargs="+", default=["auto", "extremes"])
    args = parser.parse_args()
    one_thread()
    pairs = [text.partition("=") for text in args.scans]
    scans = [contoured_scan(Path(ct), Path(drawn), Path(ct).name) for ct, _, drawn in pairs] + [phantom_scan()]
    surfaces = []
    for k in range(args.variants):
        recipe = drawn_recipe(np.random.default_rng(args.seed + k))
        recipe = recipe if args.contrast else replace(recipe, contrast_hu=0.0)
        try:
            surfaces += judged_surfaces(
                variant_of(scans[k % len(scans)], recipe, args.seed + k), args.modes, args.seed + k
            )
        except PalpateError as error:
            print(json.dumps({"variant": k, "failed": str(error)}), flush=True)
    for organ, model in error_models().items():
        print(json.dumps({"judged": "as it is", **as_it_is(surfaces, organ, model)}), flush=True)
        print(json.dumps({"judged": "fitted to the other scans", **held_out(surfaces, organ)}), flush=True)


if __name__ == "__main__":
    main()
