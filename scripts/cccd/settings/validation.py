"""Hold a configuration against the models, and say what is wrong with it in one line."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import yaml
from pydantic import ValidationError

from cccd.errors import InputError
from cccd.settings.messages import describe, nearest, show
from cccd.settings.root import Settings, whole_settings
from cccd.settings.schema import raw_schema

__all__ = ["explain", "read_config", "validate_config"]

_REFUSED_KEYS = ("extra_forbidden", "invalid_key")


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
    path, value, schema = _follow(first["loc"], config)
    key = f"config key {_dotted(path)}" if path else "config"
    if first["type"] in _REFUSED_KEYS:
        return InputError(key, "unknown key", nearest(str(path[-1]), schema.get("properties", {})))
    if isinstance(value, float) and not math.isfinite(value):
        return InputError(key, f"{value} is not a finite number", "give a number")
    if reason := first.get("ctx", {}).get("error"):
        return InputError(key, str(reason), describe(schema))
    hint = describe(schema)
    if isinstance(value, str) and "enum" in schema:
        near = nearest(value, [item for item in schema["enum"] if isinstance(item, str)])
        hint = near if near.startswith("did") else hint
    elif value is None:
        hint = f"{hint}; leave the key out to keep the default"
    return InputError(key, f"{show(value)} is not allowed", hint)


def _follow(
    location: tuple[int | str, ...], config: Mapping[str, Any]
) -> tuple[list[Any], Any, Mapping[str, Any]]:
    """Walk along an error's location as far as the configuration goes: path, value there, its schema."""
    # pydantic appends the names of a union's branches and the like, which lead nowhere. An unknown key ends
    # the path, with the schema of the section that it stands in.
    path: list[Any] = []
    value: Any = config
    schema: Mapping[str, Any] = raw_schema()
    for part in location:
        inner = _inner(schema, part)
        if isinstance(value, Mapping):
            known = {str(name): name for name in cast(Mapping[Any, Any], value)}
            if str(part) not in known:
                break
            value, path = cast(Any, value[known[str(part)]]), [*path, part]
        elif isinstance(value, (list, tuple)) and isinstance(part, int):
            value, path = cast(list[Any], value)[part], [*path, part]
        else:
            break
        if inner is None:
            break
        schema = inner
    return path, cast(Any, value), schema


def _inner(schema: Mapping[str, Any], part: int | str) -> Mapping[str, Any] | None:
    """Return the schema of one key of a mapping, or of one entry of a list."""
    if isinstance(part, str):
        named: dict[str, Any] = schema.get("properties", {})
        patterns: dict[str, Any] = schema.get("patternProperties", {})
        fitting = (inner for pattern, inner in patterns.items() if re.search(pattern, part))
        return named.get(part) or next(fitting, None)
    fixed: list[Mapping[str, Any]] = schema.get("prefixItems", [])
    return fixed[part] if part < len(fixed) else schema.get("items")


def _dotted(path: tuple[Any, ...] | list[Any]) -> str:
    return ".".join(str(part) for part in path)
