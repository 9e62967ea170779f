"""Conversion of JSON data to declared types by msgspec; an error names property, value and allowed values in one
line.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TypeVar

import msgspec
from msgspec import UNSET, UnsetType, inspect

from palpate.core.errors import InputError

T = TypeVar("T")

_OBJECT = "a JSON object"
_MISSING = re.compile(r"missing required field `(.+?)`")
_UNKNOWN = re.compile(r"unknown field `(.+?)`")
_WHERE = re.compile(r"`\$(.*)`$")
_STEP = re.compile(r"\.([^.\[\]]+)|\[(\d+|\.\.\.)\]")


def typed(data: object, kind: type[T], source: str, remedy: str = "; correct it there") -> T:
    """JSON data (parsed, not text) as an instance of a msgspec Struct, a dataclass or any type that msgspec knows.

    source : the file's path, or a description of the data. remedy : end of the error's line.
    Raises InputError naming the property, its value and what is allowed.
    """
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        raise InputError(f"{source}{_in_words(str(error), data, kind)}{remedy}") from error


def typed_strictly(data: Mapping[str, object], kind: type[T], source: str, remedy: str = "; correct it there") -> T:
    """`typed` of a JSON object, with an InputError for an undeclared key, which msgspec ignores in a dataclass."""
    declared = _fields(inspect.type_info(kind))
    for name in data:
        if name not in declared:
            raise InputError(f"{source}: {name} is unknown; allowed are {', '.join(declared)}{remedy}")
    return typed(data, kind, source, remedy)


def refusal(kind: type, name: str, value: object, source: str, remedy: str = "; correct it there") -> InputError:
    """InputError of the same form for a property that fails a check beyond its type."""
    at = _fields(inspect.type_info(kind))[name]
    return InputError(f"{source}: {name} is {_short(value)}; it must be {allowed(at)}{remedy}")


def plain(value: msgspec.Struct) -> dict[str, object]:
    """The JSON data (dict, list, str, float, ...) of an instance of a declared type, keys in the order of declaration.

    NumPy arrays and numbers become lists and numbers; unset properties are left out.
    """
    data: dict[str, object] = msgspec.to_builtins(value, enc_hook=_of_numpy)
    return data


def known(value: T | UnsetType) -> T | None:
    """Value of an optional property; None where it is unset."""
    return None if value is UNSET else value


def allowed(kind: inspect.Type) -> str:
    """Allowed values of a property of this type, in words, or the description in the type's `Meta`."""
    match kind:
        case inspect.Metadata(type=inner, extra_json_schema=extra):
            return str(extra["description"]) if extra and "description" in extra else allowed(inner)
        case inspect.UnionType(types=types):
            chosen = [allowed(t) for t in types if not isinstance(t, inspect.NoneType)]
            unknown = ", or null when unknown" if any(isinstance(t, inspect.NoneType) for t in types) else ""
            return " or ".join(chosen) + unknown
        case inspect.LiteralType(values=values):
            return " or ".join(repr(v) for v in values)
        case inspect.FloatType() | inspect.IntType():
            return _number(kind)
        case inspect.TupleType(item_types=items):
            return f"{len(items)} {allowed(items[0]).removeprefix('a ').replace('number', 'numbers', 1)}"
        case inspect.ListType(item_type=item) | inspect.VarTupleType(item_type=item):
            return f"a list, each entry {allowed(item)}"
        case inspect.BoolType():
            return "true or false"
        case inspect.StrType():
            return "a text"
    return _OBJECT


def _number(kind: inspect.FloatType | inspect.IntType) -> str:
    whole = "whole " if isinstance(kind, inspect.IntType) or kind.multiple_of == 1 else ""
    if kind.ge is not None and kind.le is not None:
        return f"a {whole}number from {kind.ge:g} to {kind.le:g}"
    limits = ((kind.ge, "of at least"), (kind.gt, "above"), (kind.le, "of at most"), (kind.lt, "below"))
    told = [f"{words} {limit:g}" for limit, words in limits if limit is not None]
    return " ".join([f"a {whole}number", " and ".join(told)]).strip()


def _in_words(message: str, data: object, kind: type) -> str:
    where = _WHERE.search(message)
    path, value, at = _walk(data, inspect.type_info(kind), where[1] if where else "")
    if missing := _MISSING.search(message):
        inner = _fields(at).get(missing[1])
        return f" has no {_joined(path, missing[1])}" + (
            f"; it must be {allowed(inner)}" if inner and _is_leaf(inner) else ""
        )
    if unknown := _UNKNOWN.search(message):
        return f": {_joined(path, unknown[1])} is unknown; allowed are {', '.join(_fields(at))}"
    return f": {path or 'it'} is {_short(value)}; it must be {allowed(at)}"


def _walk(data: object, kind: inspect.Type, steps: str) -> tuple[str, object, inspect.Type]:
    """Path in words, value and declared type at msgspec's path; a fixed tuple is named as a whole."""
    path = ""
    for name, index in _STEP.findall(steps):
        inner = _without_metadata(kind)
        if isinstance(inner, inspect.TupleType):
            break
        if name and isinstance(data, Mapping):
            step, data, kind = name, data.get(name), _fields(inner).get(name) or kind
            path = _joined(path, step)
        elif index == "..." and isinstance(data, Mapping) and isinstance(inner, inspect.DictType):
            step, data = _first_wrong(data, inner)
            path, kind = _joined(path, step), inner.value_type
        elif isinstance(data, Sequence) and isinstance(inner, inspect.ListType | inspect.VarTupleType):
            path, data, kind = f"{path}[{index}]", data[int(index)], inner.item_type
        else:
            break
    return path, data, kind


_WITH_PARTS = (
    *(inspect.StructType, inspect.DataclassType, inspect.DictType, inspect.Metadata),
    *(inspect.ListType, inspect.VarTupleType, inspect.TupleType),
)


def _without_metadata(kind: inspect.Type) -> inspect.Type:
    """The composite type inside metadata and unions."""
    while isinstance(kind, inspect.Metadata | inspect.UnionType):
        if isinstance(kind, inspect.Metadata):
            kind = kind.type
        else:
            kind = next((t for t in kind.types if isinstance(t, _WITH_PARTS)), inspect.AnyType())
    return kind


def _first_wrong(data: Mapping[str, object], kind: inspect.DictType) -> tuple[str, object]:
    """First key and value of a mapping whose value is not of its type; msgspec does not name it."""
    for key, value in data.items():
        if not _fits(value, kind.value_type):
            return str(key), value
    return next((str(key), value) for key, value in data.items())


def _fits(value: object, kind: inspect.Type) -> bool:
    inner = _without_metadata(kind)
    if isinstance(inner, inspect.StructType | inspect.DataclassType):
        try:
            msgspec.convert(value, inner.cls)
        except msgspec.ValidationError:
            return False
        return True
    if isinstance(kind, inspect.Metadata) and isinstance(kind.type, inspect.StrType):
        return isinstance(value, str) and (kind.type.pattern is None or re.search(kind.type.pattern, value) is not None)
    if isinstance(inner, inspect.FloatType):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return number and (inner.ge is None or value >= inner.ge) and (inner.le is None or value <= inner.le)  # type: ignore[operator]
    return True


def _fields(kind: inspect.Type) -> dict[str, inspect.Type]:
    inner = _without_metadata(kind)
    if isinstance(inner, inspect.StructType | inspect.DataclassType):
        return {field.encode_name: field.type for field in inner.fields}
    return {}


def _is_leaf(kind: inspect.Type) -> bool:
    return allowed(kind) != _OBJECT


def _joined(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name


def _short(value: object) -> str:
    """Text of a value for one line; a long one is cut."""
    text = repr(value)
    return text if len(text) <= 120 else f"{text[:100]} ... ({len(text)} characters)"


def _of_numpy(value: object) -> object:
    to_list = getattr(value, "tolist", None)
    if to_list is None:
        raise TypeError(f"{type(value).__name__} is not JSON")
    return to_list()
