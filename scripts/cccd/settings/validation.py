"""Hold a configuration against the models, and say what is wrong with it in one line."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import Any, cast, get_args

import yaml
from pydantic import ValidationError
from pydantic.fields import FieldInfo

from cccd.errors import InputError, nearest
from cccd.settings import Section
from cccd.settings.root import Settings, whole_settings

_REFUSED_KEYS = ("extra_forbidden", "invalid_key")

#: What pydantic says, and what people do who write YAML.
_WISHES = {
    "^Input should be ": "",
    "a valid integer": "a whole number",
    "a valid boolean": "true or false",
    "a valid string": "text",
    "a valid tuple": "a list",
    "a valid dictionary.*": "a section of keys",
    "a valid ": "a ",
    "^greater than or equal to": "a number at least",
    "^greater than": "a number above",
    "^less than or equal to": "a number at most",
    "^less than": "a number below",
    "^Tuple should have (.*) after validation.*": r"a list with \1",
}


def validate_config(config: Mapping[str, Any]) -> Settings:
    """Hold a configuration against the models.

    Parameters
    ----------
    config : mapping
        What Snakemake read and merged. Numbers, booleans and null may come as text, as Snakemake hands
        over what is nested on its command line (``--config curves='{k: 9}'``).

    Returns
    -------
    Settings
        With the defaults of every key that is left out.

    Raises
    ------
    InputError
        Names the dotted key, its value and the hint; an unknown key comes with the nearest known one.

    Examples
    --------
    >>> validate_config({"curves": {"k": "9"}}).curves.k
    9
    >>> validate_config({"curves": {"tolerance": 1}})
    Traceback (most recent call last):
    cccd.errors.InputError: config key curves.tolerance: unknown key; did you mean 'tolerance_px'?
    """
    return whole_settings()(**{str(key): value for key, value in config.items()})


def read_config(path: Path) -> Settings:
    """Read a file that changes some keys of the configuration, as Snakemake's ``--configfile`` does.

    Raises
    ------
    InputError
        Not there, no YAML, or what `validate_config` refuses.
    """
    try:
        config = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(str(path), "not there", "give a YAML file of the configuration") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(str(path), f"no YAML ({error})", "write key: value, nested by indentation") from None
    if not isinstance(config, dict):
        raise InputError(str(path), "no keys with values", "write key: value, nested by indentation")
    return validate_config(cast("dict[str, Any]", config))


def explain(error: ValidationError, config: Mapping[str, Any]) -> InputError:
    """Return one line for the violation that matters most.

    Parameters
    ----------
    error : pydantic.ValidationError
        From `cccd.settings.root.Settings`.
    config : mapping
        What it was given.
    """
    violations = error.errors(include_url=False)
    # an unknown key is most often the cause of the others (a misspelt key is also missing)
    first = min(violations, key=lambda one: (one["type"] not in _REFUSED_KEYS, _dotted(one["loc"])))
    path, value = _follow(first["loc"], config)
    key = f"config key {_dotted(path)}" if path else "config"
    section, field = _declared(path)
    if first["type"] in _REFUSED_KEYS:
        return InputError(key, "unknown key", nearest(str(path[-1]), section))
    if isinstance(value, float) and not math.isfinite(value):
        return InputError(key, f"{value} is not a finite number", "give a number")
    extra = field.json_schema_extra if field else None
    about = f" ({extra['what']})" if isinstance(extra, dict) else ""
    context = first.get("ctx", {})
    if reason := context.get("error"):
        return InputError(key, str(reason), f"give each once{about}")
    near = nearest(str(value), re.findall("'([^']*)'", str(context.get("expected", ""))))
    if isinstance(value, str) and near.startswith("did"):
        return InputError(key, f"{_show(value)} is not allowed", near)
    alike = [one for one in violations if _follow(one["loc"], config)[0] == path]
    wishes = [  # where a list's entry fails in one branch of a union, a list is wanted
        "a list" if any(isinstance(part, int) for part in one["loc"][len(path) :]) else _wish(one["msg"])
        for one in alike
    ]
    if field and NoneType in get_args(field.annotation):
        wishes.append("null")
    hint = f"give {' or '.join(dict.fromkeys(wishes))}{about}"
    if value is None:
        hint = f"{hint}; leave the key out to keep the default"
    return InputError(key, f"{_show(value)} is not allowed", hint)


def _wish(message: str) -> str:
    """Say what pydantic wants in the words of those who write YAML."""
    for pattern, words in _WISHES.items():
        message = re.sub(pattern, words, message)
    return message


def _follow(location: tuple[int | str, ...], config: Mapping[str, Any]) -> tuple[list[int | str], Any]:
    """Walk along an error's location as far as the configuration goes: the path, and the value there."""
    # pydantic appends the names of a union's branches and the like, which lead nowhere
    path: list[int | str] = []
    value: Any = config
    for part in location:
        if isinstance(value, Mapping):
            inside = {str(name): inner for name, inner in cast(Mapping[Any, Any], value).items()}
            if str(part) not in inside:
                break
            value = inside[str(part)]
        elif isinstance(value, (list, tuple)) and isinstance(part, int):
            value = cast(list[Any], value)[part]
        else:
            break
        path.append(part)
    return path, cast(Any, value)


def _declared(path: Sequence[int | str]) -> tuple[Mapping[str, FieldInfo], FieldInfo | None]:
    """Return the keys of the section that a path leads into, and the last key that is declared."""
    section, field = whole_settings(), None
    named: dict[str, FieldInfo] = {}
    for part in path:
        named = {inner.alias or name: inner for name, inner in section.model_fields.items()}
        if str(part) not in named:
            break
        field = named[str(part)]
        kind = field.annotation
        if not (isinstance(kind, type) and issubclass(kind, Section)):
            break
        section = kind
    return named, field


def _dotted(path: Sequence[int | str]) -> str:
    return ".".join(str(part) for part in path)


def _show(value: Any) -> str:
    """Write a value as it would stand in JSON, text in single quotes, cut after 60 characters."""
    text = f"'{value}'" if isinstance(value, str) else json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else text[:57] + "..."
