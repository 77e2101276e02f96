"""Parameters of a case: data with a default, a unit, bounds and a meaning for every key."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

_BOUNDS = {"gt": "> {}", "ge": ">= {}", "lt": "< {}", "le": "<= {}"}


class Parameters(BaseModel):
    """Base of a parameter set: frozen, checked on construction, of strict types.

    An integer is accepted where a real number is meant, nothing else is converted.  Every key has
    a default, and is declared by :func:`key`.  Raises pydantic.ValidationError where a value is of
    the wrong type, out of its range or not finite, and for an unknown key.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


@dataclass(frozen=True)
class Key:
    """A key of a case.  meaning, unit and bounds together are what an error message shows."""

    name: str
    default: Any
    unit: str
    bounds: str
    meaning: str


def key(default: Any, meaning: str, *, unit: str = "", bounds: str = "", **limits: Any) -> Any:
    """Declare a field of a parameter set.

    unit: empty for a number without.  bounds: what is allowed, in words; from the limits if left
    out.  limits: gt, ge, lt, le and whatever else `pydantic.Field` takes.
    """
    given = [text.format(limits[name]) for name, text in _BOUNDS.items() if name in limits]
    bounds = bounds or " and ".join(given)
    described = meaning + (f" [{unit}]" if unit else "") + (f"; {bounds}" if bounds else "")
    extra: dict[str, Any] = {"unit": unit, "bounds": bounds, "meaning": meaning}
    return Field(default=default, description=described, json_schema_extra=extra, **limits)


def keys_of(kind: type[Parameters]) -> Iterator[Key]:
    """The keys of a parameter class, in order."""
    for name, field in kind.model_fields.items():
        extra = field.json_schema_extra
        assert isinstance(extra, dict), f"{name} is not declared by key()"
        yield Key(name, field.default, *(str(extra[k]) for k in ("unit", "bounds", "meaning")))
