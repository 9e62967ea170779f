"""What a person reads in the panel: the program's figures with their intervals and qualities, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

RESEARCH_USE = "Research use only. Not for diagnosis."


def summary(results: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Lines about each step that has been done."""
    lines: list[str] = []
    steps = {"import": _imported, "segment": _segmented, "mesh": _meshed, "identify": _found, "diagnose": _diagnosed}
    for name, of_step in steps.items():
        if results.get(name):
            lines += of_step(results[name])
    return lines


def _imported(result: Mapping[str, Any]) -> list[str]:
    residual = result.get("residual_mm")
    aligned = "not aligned on bone" if residual is None else f"aligned on bone to {residual:.2f} mm (rms)"
    return [f"Scans: {aligned}", *_notes(result)]


def _segmented(result: Mapping[str, Any]) -> list[str]:
    lines = []
    for state, facts in result.get("states", {}).items():
        organs = facts.get("organs", {})
        found = [f"{name} {o['volume_cc']:.1f} cc, confidence {o['confidence']:.2f}" for name, o in organs.items()]
        lines.append(f"Labels, {state}: {'; '.join(found) or facts.get('source', 'given')}")
    return lines + _notes(result)


def _meshed(result: Mapping[str, Any]) -> list[str]:
    return [
        f"Mesh: {result['cells']} tetrahedra, smallest dihedral angle {result['min_dihedral_deg']:.0f}\N{DEGREE SIGN}"
    ]


def _found(result: Mapping[str, Any]) -> list[str]:
    lines = []
    for name, region in result["parameters"].items():
        interval = region.get("ci95_kpa")
        sure = (
            "error not known"
            if interval is None
            else f"95 % interval {_three(interval[0])} to {_three(interval[1])} kPa"
        )
        edge = ", at the edge of what was allowed: no measurement" if region.get("at_bound") else ""
        lines.append(f"{name.replace('_', ' ')}: G = {_three(region['G_kpa'])} kPa, {sure}{edge}")
    lines.append(f"Misfit: {result['misfit']['rms_mm']:.2f} mm (rms)")
    return [*lines, f"What this pair determines: {result['identifiability']['verdict']}", *_notes(result)]


def _diagnosed(result: Mapping[str, Any]) -> list[str]:
    names = ", ".join(str(name).replace("_", " ").replace("-", " ") for name in result.get("candidates", ()))
    verdict = str(result.get("verdict", "unknown"))
    said = {
        "none": "no gap beyond the noise", "unknown": "a gap of a kind that is not known",
        "ambiguous": f"a gap, by one of: {names}" if names else "the scans show too little to see one",
    }.get(verdict, verdict.replace("_", " ").replace("-", " "))  # fmt: skip
    following = str(result.get("next_measurement") or "")
    return [f"Gap between model and scan: {said}", *([f"What would settle it: {following}"] if following else [])]


def _three(value: float) -> str:
    """Three figures, as the report writes them: 40.0, 120."""
    return f"{value:#.3g}".rstrip(".")


def _notes(result: Mapping[str, Any]) -> list[str]:
    return [f"Note: {note}" for note in result.get("notes", [])]
