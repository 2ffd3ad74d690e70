"""Models of documents: classes whose fields have units, ranges and descriptions.

msgspec converts a document (parsed TOML or JSON) to the class; `read_model` replaces its first
error by a sentence with key, value and accepted range. A class may check relations between its
fields in ``__post_init__`` and raise a ValueError whose message begins with the name of a field.
"""

from __future__ import annotations

import difflib
import re
from functools import cache
from pathlib import Path
from typing import Annotated, Any, NoReturn, Self, TypeVar

import msgspec
import numpy as np
from msgspec import Meta, inspect

from domino_env.core.checks import format_range, require_choice
from domino_env.core.files import as_text, errors_with_path, one_line, read_json

# bounds of sizes in files [SI units]: products of four sizes neither overflow nor underflow
SMALLEST, LARGEST = 1e-9, 1e9

Size = Annotated[float, Meta(ge=SMALLEST, le=LARGEST)]
"""Positive size, `SMALLEST` to `LARGEST` [SI units]."""
Amount = Annotated[float, Meta(ge=0, le=LARGEST)]
"""Number from 0 to `LARGEST`."""
Number = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]
"""Number from -`LARGEST` to `LARGEST`."""


def about(description: str) -> Meta:
    """Return the metadata of a field with a description, which messages and schemas quote."""
    return Meta(description=description)


Model = TypeVar("Model")
# parts of msgspec's messages: error and path, a step of the path, a missing or unknown field
_PLACE = re.compile(r"(?P<error>.*) - at `\$(?P<path>.*)`", re.DOTALL)
_STEP = re.compile(r"\.([^.\[]+)|\[(\d+)\]")
_FIELD = re.compile(r"(?:missing required|unknown) field `(.*)`", re.DOTALL)


class Table(msgspec.Struct, forbid_unknown_fields=True):
    """Table of a file; unknown keys are rejected, and None stands for an absent key."""


class Value(Table, frozen=True):  # type: ignore[misc]
    """Frozen table whose constructor checks as `read_model` does, and accepts NumPy numbers."""

    def __post_init__(self) -> None:
        checked = read_model(_fields_alone(type(self)), plain(self))
        for name in self.__struct_fields__:
            msgspec.structs.force_setattr(self, name, getattr(checked, name))

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some fields changed."""
        return msgspec.structs.replace(self, **changes)


@cache
def _fields_alone(kind: type[Value]) -> type[msgspec.Struct]:
    """Return a Struct with the fields of a class, without its defaults and `__post_init__`."""
    entries = msgspec.structs.fields(kind)
    names = {field.name: field.encode_name for field in entries}
    return msgspec.defstruct(kind.__name__, [(f.name, f.type) for f in entries], rename=names)


def plain(value: Any) -> Any:
    """Return a value with dictionaries for Structs, and types of Python for types of NumPy."""
    return msgspec.to_builtins(value, enc_hook=_from_numpy)


def _from_numpy(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):  # "g": longdouble, which tolist keeps
        return value.astype(float).tolist() if value.dtype.char == "g" else value.tolist()
    return as_text(value)  # a string, which fields of numbers reject


class Document(msgspec.Struct):
    """Object of a file that may have more keys than the class has fields."""


def read_model(kind: type[Model], document: object, place: str = "") -> Model:
    """Read a document as an instance of a class.

    Parameters
    ----------
    kind
        A msgspec Struct, a dataclass, or a type annotated with `msgspec.Meta`.
    document
        Document read by `tomllib` or `json`.
    place
        Path of the document in the file, which messages put before its keys, such as "physics".

    Returns
    -------
    object
        Instance of the class.

    Raises
    ------
    ValueError
        If the document does not fit the class; the message has key, value and accepted range.
    """
    try:
        return msgspec.convert(document, kind)
    except msgspec.ValidationError as error:
        _reraise(error, kind, document, place)


def read_document(kind: type[Model], path: Path) -> Model:
    """Read a JSON file as an instance of a class; messages of errors begin with the path."""
    with errors_with_path(path):
        return read_model(kind, read_json(path))


def _reraise(error: msgspec.ValidationError, kind: Any, document: Any, place: str) -> NoReturn:
    """Raise a ValueError with a sentence in place of an error of msgspec."""
    match = _PLACE.fullmatch(str(error))
    message, path = (match["error"], match["path"]) if match else (str(error), "")
    steps = [key or int(index) for key, index in _STEP.findall(path)]
    type_ = inspect.type_info(kind)
    value, meaning = document, _without_metadata(type_)[1]
    for step in steps:
        value = value[step]
        type_, meaning = _entry_type(type_, step, meaning)
    place, field = _key_path(place, *steps), _FIELD.search(message)
    if error.__cause__ is not None:  # raised by __post_init__; most messages begin with a key
        sentence = str(error.__cause__)
        first = re.match(r"\w+", sentence)
        has_key = first is not None and first[0] in _fields(type_)
        sentence = f"{place}{'.' if has_key else ': '}{sentence}" if place else sentence
    elif field and "unknown" in message:
        allowed = tuple(_fields(type_))
        similar = difflib.get_close_matches(field[1][:50], allowed, n=1)
        hint = f"did you mean '{similar[0]}'? " if similar else ""
        key = one_line(_key_path(place, field[1]), 60)
        sentence = f"unknown key '{key}': {hint}allowed: {', '.join(allowed)}"
    elif field:
        type_, meaning = _entry_type(type_, field[1], "")
        sentence = f"{_key_path(place, field[1])} is missing: {_instruction(type_)}{meaning}"
    else:
        if isinstance(literal := _without_metadata(type_)[0], inspect.LiteralType):
            require_choice(place, value, literal.values)
        given = f"{place} =" if place else "this is"
        sentence = f"{given} {as_text(value)}: {_instruction(type_)}{meaning}"
    raise ValueError(sentence) from None


def _key_path(*steps: str | int) -> str:
    """Return a path such as physics.push or spacing.values[3]."""
    text = "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in steps if s != "")
    return text.removeprefix(".")


def _without_metadata(type_: Any) -> tuple[Any, str]:
    """Return a type without metadata, and the description of its field."""
    meaning = ""
    while isinstance(type_, inspect.Metadata | inspect.UnionType):
        if isinstance(type_, inspect.Metadata):
            described = (type_.extra_json_schema or {}).get("description")
            meaning = meaning or (f" ({described})" if described else "")
            type_ = type_.type
        else:
            type_ = next(t for t in type_.types if not isinstance(t, inspect.NoneType))
    return type_, meaning


def _fields(type_: Any) -> dict[str, Any]:
    """Return the types of the fields of a Struct by key; empty for another type."""
    type_, _ = _without_metadata(type_)
    return {field.encode_name: field.type for field in getattr(type_, "fields", ())}


def _entry_type(type_: Any, step: str | int, meaning: str) -> tuple[Any, str]:
    """Return the type and the description of a field of a Struct or an entry of a list."""
    if isinstance(step, str):
        field = _fields(type_)[step]
        return field, _without_metadata(field)[1]
    list_type = type_
    while not hasattr(list_type, "item_type") and not hasattr(list_type, "item_types"):
        if isinstance(list_type, inspect.UnionType):  # a number or a list of them
            list_type = next(t for t in list_type.types if hasattr(t, "item_type"))
        else:
            list_type = list_type.type
    if hasattr(list_type, "item_types"):
        return list_type.item_types[step], meaning
    return list_type.item_type, meaning


def _instruction(type_: Any) -> str:
    """Return the accepted values of a type, as an instruction."""
    while isinstance(type_, inspect.Metadata):
        type_ = type_.type
    if isinstance(type_, inspect.UnionType):
        kinds = [t for t in type_.types if not isinstance(t, inspect.NoneType)]
        return " or ".join(dict.fromkeys(_instruction(t) for t in kinds)).replace(" or give", " or")
    if isinstance(type_, inspect.LiteralType):
        return f"choose {', '.join(map(str, type_.values))}"
    if isinstance(type_, inspect.IntType):
        return f"give a whole number{_format_bounds(type_)}"
    if isinstance(type_, inspect.FloatType):
        return f"give a finite number{_format_bounds(type_)}"
    if isinstance(type_, inspect.BoolType):
        return "give true or false"
    if isinstance(type_, inspect.StrType):
        most = f" of at most {type_.max_length} characters" if type_.max_length else ""
        return f"give a line of text{most}"
    if hasattr(type_, "item_type"):
        low, high = type_.min_length, type_.max_length
        number = f"{low} to {high}" if low != high else f"{high}"
        if not (low and high):
            number = f"at most {high}" if high else f"at least {low}"
        length = f" of {number} entries" if low or high else ""
        return f"give a list{length}, each {_instruction(type_.item_type).removeprefix('give ')}"
    if hasattr(type_, "item_types"):
        return f"give a list of {len(type_.item_types)} numbers"
    return f"give a table of {', '.join(_fields(type_))}"


def _format_bounds(type_: Any) -> str:
    """Return the range of a number as `format_range`; empty for that of a `Number`."""
    if (type_.ge, type_.le) == (-LARGEST, LARGEST):
        return ""
    return format_range(type_.ge, type_.le, above=type_.gt, below=type_.lt)
