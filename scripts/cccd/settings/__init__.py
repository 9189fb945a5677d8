"""The configuration: one typed model per stage, with default, range, unit and reason of every key.

Here is what they are made of: a frozen model, and fields that give their reasons. From the models come
``config/config.yaml``, ``workflow/schemas/config.schema.yaml`` and ``docs/configuration.md`` (``python
docs/settings_pages.py`` writes them). Each stage imports its own module, so that an edit of one stage's
settings runs no other again; `cccd.settings.root` holds them all.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from inspect import Parameter, Signature
from typing import Any, TypeVar, cast

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
    ValidatorFunctionWrapHandler,
    field_validator,
)
from pydantic_core import PydanticKnownError, core_schema

_T = TypeVar("_T")

#: What plain words of YAML stand for. Snakemake's command line hands them over as text.
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}


def setting(default: _T, what: str, *, why: str, unit: str = "", **limits: Any) -> _T:
    """Declare one key of the configuration.

    Parameters
    ----------
    default : value
        What holds when nobody says otherwise; for a group of keys, the group's own model.
    what : str
        What the key is, in a few words: the comment in ``config.yaml``.
    why : str
        Why it has this default, in a sentence: it stands on the configuration page of the docs.
    unit : str
        Unit of a number; a count or a share is named as such.
    **limits
        ``gt``, ``ge``, ``lt``, ``le``, ``min_length``, ``max_length``, as in `pydantic.Field`.

    Returns
    -------
    field
        What pydantic takes for a field with all that; typed as the default for the type checker's sake.

    Examples
    --------
    >>> class Scissors(Section):
    ...     length_mm: float = setting(120.0, "length of the blades", why="Fits a hand.", unit="mm", gt=0)
    >>> Scissors(length_mm=90).length_mm
    90.0
    """
    extra: dict[str, Any] = {"what": what, "why": why, "unit": unit}
    described = f"{what} [{unit}]" if unit else what
    about = f"{described[:1].upper()}{described[1:].rstrip('.')}. {why}"
    return cast(_T, Field(cast(Any, default), description=about, json_schema_extra=extra, **limits))


class Section(BaseModel):
    """A section of the configuration: it cannot be changed, and knows no key but its own.

    Types are strict (true is no number, 2.5 no whole number). Only text that stands for a number, a boolean
    or null where the field cannot be text is read as such, lists become tuples, and 2.0 is a whole number.

    Examples
    --------
    >>> class Marks(Section):
    ...     level: int | None = setting(None, "a level", why="It may be absent.", unit="count")
    >>> Marks.model_validate({"level": "9"}), Marks.model_validate({"level": "null"})
    (Marks(level=9), Marks(level=None))
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Leave the defaults of all keys out of the signature: `help` would open with pages of them."""
        super().__pydantic_init_subclass__(**kwargs)
        cls.__signature__ = Signature([Parameter("keys", Parameter.VAR_KEYWORD)])

    @field_validator("*", mode="wrap")
    @classmethod
    def _read(cls, value: Any, check: ValidatorFunctionWrapHandler) -> Any:
        if isinstance(value, str) and _read_value(value) is None:
            with suppress(ValidationError):
                return check(None)  # a text may be None, and is not to be the text "null"
        try:
            return check(value)
        except ValidationError:
            read = _read_value(value)
            if type(read) is type(value):
                raise
            return check(read)

    def as_config(self) -> dict[str, Any]:
        """Return the section as plain values: what YAML holds and rules hand to jobs."""
        return self.model_dump(mode="json", by_alias=True)


def _read_value(value: Any) -> Any:
    """Return the number, boolean or null that a text stands for, tuples for lists, and 2 for 2.0."""
    if isinstance(value, list):
        return tuple(map(_read_value, cast(list[Any], value)))
    if isinstance(value, str):
        if value.lower() in _WORDS:
            return _WORDS[value.lower()]
        with suppress(ValueError):
            value = float(value)
    return int(value) if isinstance(value, float) and value.is_integer() else value


@dataclass(frozen=True)
class OneOf:
    """A text is one of some names, which packages' tables have: they are loaded when a text is checked."""

    names: Callable[[], tuple[str, ...]]

    def _check(self, value: Any) -> Any:
        if value in (names := self.names()):
            return value
        *quoted, last = map(repr, names)
        raise PydanticKnownError("literal_error", {"expected": f"{', '.join(quoted)} or {last}"})

    def __get_pydantic_core_schema__(self, _: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self._check)

    def __get_pydantic_json_schema__(self, _: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"enum": [*self.names()], "type": "string"}


def without_repeats(values: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names; refuse any that comes twice."""
    repeated = sorted({name for name in values if values.count(name) > 1})
    if repeated:
        raise ValueError(f"{', '.join(repeated)} stands there twice")
    return values
