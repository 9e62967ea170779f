"""Library of effects that a model may leave out, by id. Each file of this folder defines one EFFECT.

`library(folder)` also reads a user's own effects from the files of another folder.
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from pathlib import Path
from types import ModuleType

from palpate.core.errors import InputError
from palpate.core.forward.effect import Effect, Parameter, Surroundings, Variant

__all__ = ["Effect", "Parameter", "Surroundings", "Variant", "library"]


def library(folder: Path | None = None) -> dict[str, Effect]:
    """All effects by id: the program's own, then those of the *.py files in `folder`.

    Raises InputError when a file of `folder` defines no EFFECT or one whose id is taken.
    """
    effects: dict[str, Effect] = {}
    for name in sorted(m.name for m in pkgutil.iter_modules(__path__)):
        effect = importlib.import_module(f"{__name__}.{name}").EFFECT
        effects[effect.id] = effect
    for path in sorted(folder.glob("*.py")) if folder is not None else ():
        effect = getattr(_load(path), "EFFECT", None)
        if not isinstance(effect, Effect):
            raise InputError(f"{path} defines no EFFECT; see docs/effects.md for what one needs")
        if effect.id in effects:
            raise InputError(f"{path}: the effect id '{effect.id}' is taken; choose another")
        effects[effect.id] = effect
    return effects


def _load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"palpate_user_effect_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"{path} cannot be read as a Python file; check its name")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (SyntaxError, ImportError, NameError, AttributeError, TypeError, ValueError) as error:
        raise InputError(f"{path} cannot be loaded ({type(error).__name__}: {error}); correct it") from error
    return module
