"""Notes on an identification: agreement of the searches, size of the misfit, stiffness at a bound."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from msgspec.structs import replace

from palpate.core.identify.identify import Identification
from palpate.core.identify.result_parameters import parameter_facts
from palpate.core.identify.result_record import AgreementRecord

# Largest difference of ln G, in standard deviations, at which swarm and Gauss-Newton count as the same optimum.
AGREEMENT_SD = 0.25
# Largest difference, in standard deviations, at which the interval covers both optima about equally well.
HARMLESS_SD = 0.5


def agreement(identification: Identification, names: tuple[str, ...]) -> AgreementRecord:
    """Comparison of the optima of swarm and Gauss-Newton, kPa; differences in standard deviations of each region's ln
    G.

    in_words : one sentence where they differ by more than AGREEMENT_SD, else empty. harmless : whether they differ by
    less than HARMLESS_SD.
    """
    parameters = identification.scene.parameters
    gauss_newton = dict(zip(names, parameters.shear_moduli(identification.theta).tolist(), strict=True))
    facts = AgreementRecord(
        gauss_newton_G_kpa=gauss_newton,
        starts_agree=identification.starts_agree,
        largest_ln_G_difference=identification.agreement,
    )
    if identification.swarm is None:
        return facts
    swarm = dict(zip(names, parameters.shear_moduli(identification.swarm.theta).tolist(), strict=True))
    difference = (identification.swarm.theta - identification.theta)[parameters.stiffness]
    difference_sd = (np.abs(difference) / identification.stiffness.sd).tolist()
    same = max(difference_sd) < AGREEMENT_SD
    return replace(
        facts,
        swarm_G_kpa=swarm,
        difference_sd=dict(zip(names, difference_sd, strict=True)),
        same_optimum=same,
        harmless=max(difference_sd) < HARMLESS_SD,
        in_words="" if same else different(swarm, gauss_newton, difference_sd),
    )


def different(swarm: Mapping[str, float], gauss_newton: Mapping[str, float], apart: list[float]) -> str:
    """Sentence on two searches that end at different stiffnesses, kPa by region.

    apart : difference of each region in standard deviations.
    """
    values = "; ".join(
        f"{name.replace('_', ' ')} {G:.3g} and {gauss_newton[name]:.3g} kPa, {sd:.2g} sd of its interval apart"
        for (name, G), sd in zip(swarm.items(), apart, strict=True)
    )
    verdict = (
        "harmless, as less than half an sd"
        if max(apart) < HARMLESS_SD
        else "the misfit may have more than one low place, of which the interval knows one"
    )
    return f"swarm and Gauss-Newton end at different stiffnesses ({values}): {verdict}"


def too_large(scale: float) -> str:
    """Note on a weighted residual that exceeds the noise. It names no distance: the misfit is the one figure of that.

    scale : ratio of its square to that of the noise (`Posterior.scale`). "" where two digits do not show it.
    """
    if round(scale, 2) <= 1.0:
        return ""
    return f"the weighted residual is {scale:.2f} times what the stated noise explains: intervals are widened by that factor"


def notes(result: Identification, names: tuple[str, ...]) -> list[str]:
    """Notes, one line each."""
    out = []
    if len(result.solutions) > 1:
        out.append(
            f"one stiffness from {len(result.solutions)} deformed states together; pictures and the map within the organ show the first"
        )
    searches = agreement(result, names)
    if searches.in_words:
        out.append(searches.in_words)
    if not result.starts_agree:
        out.append(f"Gauss-Newton ends at different stiffnesses from different starts: {_ends(result, names)}")
    if widened := too_large(result.posterior.scale):
        out.append(widened)
    for name, values in parameter_facts(names, result.scene.parameters, result.posterior).items():
        if values.at_bound:
            out.append(
                f"{name} lies at the edge of the allowed stiffness: it may absorb an effect that is not modelled"
            )
    return out


def _ends(identification: Identification, names: tuple[str, ...]) -> str:
    """``prostate left 5 to 12 kPa, prostate right ...``: range of the optima over all starts."""
    ends = np.array([identification.scene.parameters.shear_moduli(theta) for theta in identification.fit.optimum.ends])
    return ", ".join(
        f"{name.replace('_', ' ')} {low:.3g} to {high:.3g} kPa"
        for name, low, high in zip(names, ends.min(axis=0), ends.max(axis=0), strict=True)
    )
