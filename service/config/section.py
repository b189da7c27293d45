"""What every table of the configuration file has in common, and the words its fields are made of.

A section is immutable, knows its keys and refuses others. Numbers are strict (``"5"`` and ``true`` are no
numbers) and finite. Vectors say in their errors what they hold and how much of it came.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import date, time
from typing import Annotated, Any, cast

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError


class Section(BaseModel):
    """One table of the file: frozen, and no key but its own."""

    model_config = ConfigDict(frozen=True, extra="forbid")


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
Whole = Annotated[int, Field(strict=True)]
Flag = Annotated[bool, Field(strict=True)]

NAME_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$"
Name = Annotated[str, Field(pattern=NAME_PATTERN)]


def one_line(text: str) -> str:
    """Return a text with what would break its line or colour the terminal written as escapes."""
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in text)


def shown(value: object) -> str:
    """Return a value as the file would write it, short enough for one line."""
    if isinstance(value, bool):
        words = str(value).lower()
    elif isinstance(value, str):
        words = one_line(f'"{value}"')
    elif isinstance(value, dict):
        words = "a table"
    elif isinstance(value, date | time):
        words = value.isoformat()
    else:
        words = repr(value)
    return words if len(words) <= 60 else words[:57] + "…"


def _numbers(*names: str) -> Callable[[Any], Any]:
    """Return a validator: an array with one number for each of ``names``."""
    wanted = f"needs {len(names)} numbers ({', '.join(names)})"

    def check(value: Any) -> Any:
        if not isinstance(value, list | tuple):
            raise PydanticCustomError(
                "vector", "{wanted}, got {got}", {"wanted": wanted, "got": shown(value)}
            )
        items = cast("Sequence[Any]", value)
        if len(items) != len(names):
            raise PydanticCustomError("vector", "{wanted}, got {got}", {"wanted": wanted, "got": len(items)})
        return items

    return check


def _ascending(value: tuple[float, float]) -> tuple[float, float]:
    low, high = value
    if low >= high:
        raise PydanticCustomError(
            "interval",
            "needs the smaller number first, got [{low}, {high}]",
            {"low": low, "high": high},
        )
    return value


NorthEastDown = Annotated[tuple[Number, Number, Number], BeforeValidator(_numbers("north", "east", "down"))]
SigmaNorthEastDown = Annotated[
    tuple[NotNegative, NotNegative, NotNegative], BeforeValidator(_numbers("north", "east", "down"))
]
ForwardRight = Annotated[tuple[Number, Number], BeforeValidator(_numbers("forward", "right"))]
Interval = Annotated[
    tuple[Number, Number], BeforeValidator(_numbers("lowest", "highest")), AfterValidator(_ascending)
]
Latitude = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-90, le=90)]
Longitude = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-180, le=180)]
