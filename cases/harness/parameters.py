"""Parameters of a case: data with a default, a unit, bounds and a meaning for every key."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType, NoneType
from typing import Annotated, Any, ClassVar, Literal, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator
from pydantic.fields import FieldInfo

from softehl.cases.harness.units import is_number, is_quantity, read_number, read_quantity

_BOUNDS = {"gt": "> {:g}", "ge": ">= {:g}", "lt": "< {:g}", "le": "<= {:g}"}


def different(numbers: tuple[float, ...]) -> tuple[float, ...]:
    """The numbers, none 0 and none twice.  ValueError."""
    if len(set(numbers)) < len(numbers):
        raise ValueError("a number is given twice")
    if 0.0 in numbers:
        raise ValueError("a number is 0")
    return numbers


# strict again on the item: the list itself is lax so that a TOML array becomes a tuple
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Nonzeros = Annotated[
    tuple[Number, ...], Field(min_length=1, strict=False), AfterValidator(different)
]
"""One or more different numbers that are not 0."""


class Parameters(BaseModel):
    """Base of a parameter set: frozen, checked on construction, of strict types.

    Accepted are an integer for a real number, the text of a number ("5", "5,5"), and one value for
    a list of any length. A key with a unit also takes a text with a unit ("50 bar"). Nothing else
    is converted.  Every key has a default, and is declared by :func:`key`.
    Raises pydantic.ValidationError where a value is of the wrong type, out of its range or not
    finite, and for an unknown key.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)
    names: ClassVar[tuple[str, ...]] = ()
    """Keys that do no more than give values to others, such as the name of a standard part."""
    hints: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """A key that there is not -> what to write instead."""
    headings: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({})
    """Heading -> keys, in the order in which they are listed; the others follow without one."""

    @model_validator(mode="before")
    @classmethod
    def _without_units(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        worded = cls.worded(values)
        return cls.completed(
            {name: without_unit(cls, name, _as_list(cls, name, v)) for name, v in worded.items()}
        )

    @classmethod
    def worded(cls, values: dict[str, Any]) -> dict[str, Any]:
        """The values without words of a trade, before units are read.  Raises ValueError."""
        return values

    @classmethod
    def completed(cls, values: dict[str, Any]) -> dict[str, Any]:
        """The values with those that follow from them; for cases whose keys name one another.

        Raises ValueError.
        """
        return values

    def __hash__(self) -> int:
        """Of all values; a table counts by its entries in any order."""
        values = (getattr(self, name) for name in type(self).model_fields)
        return hash(tuple(frozenset(v.items()) if isinstance(v, dict) else v for v in values))

    def settled(self) -> dict[str, Any]:
        """The values of all keys, without the names that they came from: each can be changed."""
        fields = type(self).model_fields
        return {**self.model_dump(), **{name: fields[name].default for name in self.names}}

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Describe every key once its type is known."""
        for field in cls.model_fields.values():
            extra = declared(field)
            extra["bounds"] = bounds = extra["bounds"] or _values(field.annotation)
            unit = f" [{extra['unit']}]" if extra["unit"] else ""
            field.description = f"{extra['meaning']}{unit}" + (f"; {bounds}" if bounds else "")


def without_unit(kind: type[Parameters], name: str, value: object) -> object:
    """A value without a unit, in that of its key; lists item by item.  Raises ValueError."""
    if isinstance(value, list | tuple):
        return [without_unit(kind, name, item) for item in value]
    field = kind.model_fields.get(name)
    if field is None or not isinstance(value, str):
        return value
    unit = declared(field)["unit"]
    try:
        if unit and is_quantity(value):
            return read_quantity(value, unit)
        if is_number(value) and _numeric(field.annotation):
            return read_number(value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    return value


def _numeric(kind: Any) -> bool:
    """True if a type has numbers, or lists of numbers, and nothing else but None."""
    if get_origin(kind) is Literal:
        return all(type(value) is int for value in get_args(kind))
    if get_origin(kind) is Annotated:
        return _numeric(get_args(kind)[0])
    parts = [part for part in get_args(kind) if part not in (NoneType, ...)]
    return kind in (int, float) or (bool(parts) and all(map(_numeric, parts)))


def _as_list(kind: type[Parameters], name: str, value: object) -> object:
    """A value, in a list of its own where a key wants one of such values."""
    field = kind.model_fields.get(name)
    item = _item(field.annotation) if field else None
    if isinstance(value, str):
        parts = [part.strip() for part in value.split(",")]
        if field and _list_of_numbers(field.annotation) and is_number(value) and len(parts) > 1:
            return _comma(name, value, parts, any_length=item is float)
        if item is float and len(parts) > 1 and all(map(is_quantity, parts)):
            return parts
        single = item is str or (item is float and (is_quantity(value) or is_number(value)))
    else:
        single = item is float and type(value) in (int, float)
    return [value] if single else value


def _comma(name: str, text: str, parts: list[str], *, any_length: bool) -> list[str]:
    """The two numbers of "400,100", for a key that wants a list.

    Raises ValueError where that is rather a number with a decimal comma.
    """
    first, second = map(read_number, parts)
    if any_length and 0 not in (first, second) and first != second:
        return parts
    raise ValueError(
        f'{name} = "{text}": write a number as {text.replace(",", ".")}, a list as '
        f"[{', '.join(parts)}]"
    )


def _list_of_numbers(kind: Any) -> bool:
    """True if a type, or one of a union, is a list of numbers."""
    if get_origin(kind) is tuple:
        return _numeric(kind)
    return any(map(_list_of_numbers, get_args(kind)))


def _item(kind: Any) -> Any:
    """Type of the items of a list of any length; None if the type is no list."""
    if get_origin(kind) is not tuple:
        return next(filter(None, map(_item, get_args(kind))), None)
    first, *others = get_args(kind)
    if others != [...]:
        return None
    return get_args(first)[0] if get_origin(first) is Annotated else first


@dataclass(frozen=True)
class Key:
    """A key of a case.  meaning, unit and bounds together are what an error message shows.

    heading: what it is listed under, empty for none.
    """

    name: str
    default: Any
    unit: str
    bounds: str
    meaning: str
    heading: str = ""


def key(
    default: Any,
    meaning: str,
    *,
    unit: str = "",
    bounds: str = "",
    file: bool = False,
    **limits: Any,
) -> Any:
    """Declare a field of a parameter set.

    unit: empty for a number without.  bounds: what is allowed, in words; from limits and type if
    left out.  file: whether it is the path of a file, which a case file gives relative to itself.
    limits: gt, ge, lt, le and whatever else `pydantic.Field` takes.
    """
    bounds_texts = [text.format(limits[name]) for name, text in _BOUNDS.items() if name in limits]
    bounds = bounds or " and ".join(bounds_texts)
    extra: dict[str, Any] = {"unit": unit, "bounds": bounds, "meaning": meaning, "file": file}
    return Field(default=default, json_schema_extra=extra, **limits)


def declared(field: FieldInfo) -> dict[str, Any]:
    """Unit, bounds, meaning and file of a field that was declared by `key`."""
    extra = field.json_schema_extra
    assert isinstance(extra, dict), "a field is not declared by key()"
    return extra


def _values(kind: Any) -> str:
    """Allowed values of a type in words, if it has a few values or is a list of numbers."""
    if kind is bool:
        return "true or false"
    if get_origin(kind) is tuple:
        return "a number or a list of different ones, none 0"
    if get_origin(kind) is not Literal:
        return ""
    *others, last = map(json.dumps, get_args(kind))
    return f"{', '.join(others)} or {last}"


def files_of(kind: type[Parameters]) -> tuple[str, ...]:
    """The keys that are paths of files."""
    return tuple(name for name, field in kind.model_fields.items() if declared(field)["file"])


def keys_of(kind: type[Parameters]) -> Iterator[Key]:
    """The keys of a parameter class, by their headings."""
    under = {name: heading for heading, names in kind.headings.items() for name in names}
    for name in [*under, *(name for name in kind.model_fields if name not in under)]:
        field = kind.model_fields[name]
        unit, bounds, meaning = (declared(field)[k] for k in ("unit", "bounds", "meaning"))
        yield Key(name, field.default, unit, bounds, meaning, under.get(name, ""))
