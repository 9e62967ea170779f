"""The site's page of the numbers that a diagnosis hangs on, from the option types that declare them.

`docs/site_hooks.py` makes it at every build of the site.
"""

from __future__ import annotations

import inspect

from palpate.core.diagnose.effects import Parameter, library
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.sourced_number import Row

HEAD = """# The numbers that a diagnosis hangs on

Made from the option types, which are passed down from `diagnose`. The values in force of a diagnosis are under `options` in its
`diagnosis.json`. [The diagnosis](../gap.md) says what they are used for. A source that begins with "Chosen" is a
choice without a measurement of its own behind it; "Numerical" says that a number settles how finely something is computed.
"""


EFFECTS = """
## Priors of the effects

Of each effect's parameters, in the coordinate phi that is fitted (`core/diagnose/effects/`, a file each): a normal prior around 0, cut off
at the bounds. Evidence pays for a wide prior, so that these decide too. Chosen, all of them: sizes that patients may have, none of
them measured. The blind check draws the strength of what it hides from what shows above the noise floor, not from these.

| effect | parameter | standard deviation of phi | bounds of phi | unit that is told |
| --- | --- | --- | --- | --- |
"""


def page() -> str:
    """The page's text."""
    parts = [HEAD]
    for kind, numbers in DiagnosisOptions().tables().items():
        module = kind.__module__.removeprefix("palpate.").replace(".", "/")
        parts.append(f"\n## {kind.__name__}\n\n{inspect.getdoc(kind)} Declared in `{module}.py`.\n")
        parts.append("\n| number | value | unit | what it is | source |\n| --- | --- | --- | --- | --- |\n")
        parts += [_line(row) for row in numbers]
    parts.append(EFFECTS)
    for effect in library().values():
        parts += [_prior(effect.id, parameter) for parameter in effect.parameters]
    return "".join(parts)


def _line(row: Row) -> str:
    values = row.value if isinstance(row.value, tuple) else (row.value,)
    cells = (f"`{row.name}`", ", ".join(f"{v:g}" for v in values), row.unit, row.meaning, row.source)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n"


def _prior(effect: str, parameter: Parameter) -> str:
    bounds = f"{parameter.low:g} to {parameter.high:g}"
    return f"| `{effect}` | `{parameter.name}` | {parameter.scale:g} | {bounds} | {parameter.unit} |\n"
