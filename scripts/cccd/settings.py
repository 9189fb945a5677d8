"""Check settings against their JSON schema and say what is wrong in one line.

Imported at every parse of the workflow, so it imports nothing heavy.
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml
from jsonschema import Draft202012Validator
from jsonschema.exceptions import ValidationError

from cccd.errors import InputError

__all__ = ["choices", "describe", "load_schema", "nearest", "validate_config"]

_TYPE_NAMES = {
    "array": "a list",
    "boolean": "true or false",
    "integer": "a whole number",
    "null": "null",
    "number": "a number",
    "object": "a section of keys",
    "string": "text",
}


def nearest(word: str, candidates: Iterable[str]) -> str:
    """Give ``"did you mean 'x'?"`` for a near miss, otherwise ``"choose one of ..."``."""
    known = list(candidates)
    lower = {name.lower(): name for name in reversed(known)}
    match = difflib.get_close_matches(str(word).lower(), lower, n=1, cutoff=0.6)
    return f"did you mean {lower[match[0]]!r}?" if match else choices(known)


def choices(candidates: Iterable[Any], limit: int = 20) -> str:
    """Give ``"choose one of a, b, c"``, cut after ``limit`` names."""
    names = [str(name) for name in candidates]
    if not names:
        return "there is nothing to choose from"
    more = f" ... ({len(names)} in all)" if len(names) > limit else ""
    return f"choose one of {', '.join(names[:limit])}{more}"


def load_schema(path: str | Path) -> dict:
    """Read a JSON schema (draft 2020-12) written as YAML."""
    schema = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    return schema


def describe(schema: Mapping) -> str:
    """Say what a value must be, in words: kind, choices, range, and the key's own description."""
    for union in ("anyOf", "oneOf"):
        if union in schema:
            wanted = " or ".join(_kind(option) for option in schema[union])
            break
    else:
        wanted = _kind(schema)
    about = " ".join(str(schema.get("description", "")).split()).rstrip(".")
    return f"give {wanted}" + (f" ({about})" if about else "")


def _kind(schema: Mapping) -> str:
    if "enum" in schema:
        return "one of " + ", ".join(_show(item) for item in schema["enum"])
    if "const" in schema:
        return _show(schema["const"])
    types = schema.get("type", "object")
    kind = " or ".join(_TYPE_NAMES[name] for name in ([types] if isinstance(types, str) else types))
    low, high = schema.get("minimum"), schema.get("maximum")
    above, below = schema.get("exclusiveMinimum"), schema.get("exclusiveMaximum")
    bounds = [f"at least {low}"] if low is not None else [f"above {above}"] if above is not None else []
    bounds += [f"at most {high}"] if high is not None else [f"below {below}"] if below is not None else []
    if schema.get("type") == "array":
        few, many = schema.get("minItems"), schema.get("maxItems")
        if few is not None:
            bounds += [f"with {few} entries" if few == many else f"with at least {few} entries"]
        if isinstance(schema.get("items"), Mapping):
            bounds += [f"each {_kind(schema['items'])}"]
    return " ".join([kind, " and ".join(bounds)]).rstrip()


def _show(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False, default=str) if not isinstance(value, str) else f"'{value}'"
    return text if len(text) <= 60 else text[:57] + "..."


def _numbers(value: Any, path: tuple = ()) -> Iterator[tuple[tuple, float]]:
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from _numbers(part, (*path, key))
    elif isinstance(value, (list, tuple)):
        for index, part in enumerate(value):
            yield from _numbers(part, (*path, index))
    elif isinstance(value, float):
        yield path, value


def _looks_numeric(value: Any) -> bool:
    try:
        return isinstance(value, str) and math.isfinite(float(value))
    except ValueError:
        return False


def _dotted(path: Iterable) -> str:
    return ".".join(str(part) for part in path)


def _explain(error: ValidationError) -> InputError:
    """One line for the first violation found."""
    path, value, schema = list(error.absolute_path), error.instance, error.schema
    key = _dotted(path)
    if error.validator == "additionalProperties":
        known = list(schema.get("properties", {}))
        unknown = next(name for name in value if name not in known)
        location = f"config key {_dotted([*path, unknown])}"
        return InputError(location, "unknown key", nearest(str(unknown), known))
    if error.validator == "required":
        absent = next(name for name in schema["required"] if name not in value)
        wanted = describe(schema.get("properties", {}).get(absent, {}))
        return InputError(f"config key {_dotted([*path, absent])}", "missing", wanted)
    hint = describe(schema)
    if isinstance(value, str) and "enum" in schema:
        near = nearest(value, [item for item in schema["enum"] if isinstance(item, str)])
        hint = near if near.startswith("did") else hint
    elif error.validator in ("type", "anyOf", "oneOf") and _looks_numeric(value):
        hint = f"{hint}; YAML reads this as text, write {float(value):g} without quotes or as 0.001, not 1e-3"
    elif value is None:
        hint = f"{hint}; leave the key out to keep the default"
    return InputError(f"config key {key}" if key else "config", f"{_show(value)} is not allowed", hint)


def validate_config(config: Mapping, schema_path: str | Path) -> None:
    """Hold a configuration against its schema.

    Parameters
    ----------
    config : mapping
        What Snakemake read and merged.
    schema_path : path
        JSON schema (draft 2020-12) as YAML.

    Raises
    ------
    InputError
        Names the dotted key, its value and the hint; an unknown key comes with the nearest known one.

    Notes
    -----
    JSON schema lets NaN pass every bound, so numbers that are not finite are refused beforehand.
    """
    for path, value in _numbers(config):
        if not math.isfinite(value):
            raise InputError(
                f"config key {_dotted(path)}", f"{value} is not a finite number", "give a number"
            )
    validator = Draft202012Validator(load_schema(schema_path))
    errors = sorted(
        validator.iter_errors(config), key=lambda error: (_dotted(error.absolute_path), error.message)
    )
    # an unknown key is most often the cause of the others (a misspelt required key is also missing)
    errors.sort(key=lambda error: error.validator != "additionalProperties")
    if errors:
        raise _explain(errors[0])
