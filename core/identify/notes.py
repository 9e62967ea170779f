"""What a person should know of an identification beside its figures: whether searches agree, whether the misfit is too large."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from msgspec.structs import replace

from palpate.core.identify.identify import Identification
from palpate.core.identify.result_parameters import parameter_facts
from palpate.core.identify.result_record import AgreementRecord

# Swarm and Gauss-Newton name the same optimum when no region's ln G differs by more than this share of its standard deviation.
AGREEMENT_SD = 0.25
# Below this share the interval holds both about equally well.
HARMLESS_SD = 0.5


def agreement(found: Identification, names: tuple[str, ...]) -> AgreementRecord:
    """Where swarm and Gauss-Newton ended, kPa, and how far apart in standard deviations of each region's ln G.

    in_words : one sentence where they differ by more than AGREEMENT_SD, else empty. harmless : whether by less than HARMLESS_SD.
    """
    parameters = found.scene.parameters
    by = dict(zip(names, parameters.shear_moduli(found.optimum.fit.theta).tolist(), strict=True))
    facts = AgreementRecord(
        gauss_newton_G_kpa=by, starts_agree=found.optimum.agree, largest_ln_G_difference=found.agreement
    )
    if found.swarm is None:
        return facts
    swarm = dict(zip(names, parameters.shear_moduli(found.swarm.theta).tolist(), strict=True))
    difference = (found.swarm.theta - found.optimum.fit.theta)[parameters.stiffness]
    apart = (np.abs(difference) / found.stiffness.sd).tolist()
    same = max(apart) < AGREEMENT_SD
    return replace(
        facts,
        swarm_G_kpa=swarm,
        difference_sd=dict(zip(names, apart, strict=True)),
        same_optimum=same,
        harmless=max(apart) < HARMLESS_SD,
        in_words="" if same else different(swarm, by, apart),
    )


def different(swarm: Mapping[str, float], gauss_newton: Mapping[str, float], apart: list[float]) -> str:
    """The sentence on two searches that end at different stiffnesses, kPa by region; apart : in standard deviations of each."""
    values = "; ".join(
        f"{name.replace('_', ' ')} {G:.3g} and {gauss_newton[name]:.3g} kPa, {sd:.2g} sd of its interval apart"
        for (name, G), sd in zip(swarm.items(), apart, strict=True)
    )
    judged = (
        "harmless, as less than half an sd"
        if max(apart) < HARMLESS_SD
        else "the misfit may have more than one low place, of which the interval knows one"
    )
    return f"swarm and Gauss-Newton end at different stiffnesses ({values}): {judged}"


def too_large(scale: float, rms_mm: float, expected_mm: float) -> str:
    """The note on a misfit above what noise explains. scale : that ratio in the fit's own weights (`Posterior.scale`)."""
    return (
        f"the misfit is {scale:.2f} times what the stated noise explains, in the weights of the fit, and intervals are widened by that "
        f"factor; in plain distance it is {rms_mm / expected_mm:.1f} times ({rms_mm:.2f} mm rms against {expected_mm:.2f} mm), which the "
        "fit does not use because it trusts neither fine detail of contours nor what errors of the walls can cause"
    )


def notes(found: Identification, names: tuple[str, ...], rms_mm: float, expected_mm: float) -> list[str]:
    """One line each. rms_mm, expected_mm : of the first state's misfit, as it is and as noise alone would leave it."""
    out = []
    if len(found.states) > 1:
        out.append(
            f"one stiffness from {len(found.states)} deformed states together; pictures and the map within the organ show the first"
        )
    searches = agreement(found, names)
    if searches.in_words:
        out.append(searches.in_words)
    if not found.optimum.agree:
        out.append(f"Gauss-Newton ends at different stiffnesses from different starts: {_ends(found, names)}")
    if found.posterior.scale > 1.0:
        out.append(too_large(found.posterior.scale, rms_mm, expected_mm))
    for name, values in parameter_facts(names, found.scene.parameters, found.posterior).items():
        if values.at_bound:
            out.append(
                f"{name} lies at the edge of the allowed stiffness: it may absorb an effect that is not modelled"
            )
    return out


def _ends(found: Identification, names: tuple[str, ...]) -> str:
    """``prostate left 5 to 12 kPa, prostate right ...`` over all starts."""
    ends = np.array([found.scene.parameters.shear_moduli(theta) for theta in found.optimum.others])
    return ", ".join(
        f"{name.replace('_', ' ')} {low:.3g} to {high:.3g} kPa"
        for name, low, high in zip(names, ends.min(axis=0), ends.max(axis=0), strict=True)
    )
