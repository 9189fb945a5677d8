"""Say what is wrong with a value, and what would be right, in one line."""

from __future__ import annotations

import difflib
import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any

__all__ = ["choices", "describe", "nearest", "show"]

_TYPE_NAMES = {
    "array": "a list",
    "boolean": "true or false",
    "integer": "a whole number",
    "null": "null",
    "number": "a number",
    "object": "a section of keys",
    "string": "text",
}


def nearest(
    word: str, candidates: Iterable[str], named: Callable[[str], str] = str, otherwise: str = ""
) -> str:
    """Return ``"did you mean 'x'?"`` for a near miss, otherwise ``"choose one of ..."`` or other advice.

    Parameters
    ----------
    word : str
    candidates : iterable of str
    named : callable
        Gives the part of each that is compared, such as a file's name without its suffix.

    >>> nearest("livre", ["liver", "spleen"])
    "did you mean 'liver'?"
    """
    known = list(candidates)
    lower = {named(name).lower(): name for name in reversed(known)}
    match = difflib.get_close_matches(named(str(word)).lower(), lower, n=1, cutoff=0.6)
    return f"did you mean {lower[match[0]]!r}?" if match else otherwise or choices(known)


def choices(candidates: Iterable[Any], limit: int = 20) -> str:
    """Return ``"choose one of a, b, c"``, cut after ``limit`` names."""
    names = [str(name) for name in candidates]
    if not names:
        return "there is nothing to choose from"
    more = f" ... ({len(names)} in all)" if len(names) > limit else ""
    return f"choose one of {', '.join(names[:limit])}{more}"


def describe(schema: Mapping[str, Any]) -> str:
    """Say what a value must be by its JSON schema: kind, choices, range, and the key's own description.

    >>> describe({"type": "integer", "minimum": 1, "description": "Slices."})
    'give a whole number at least 1 (Slices)'
    """
    about = " ".join(str(schema.get("description", "")).split()).rstrip(".")
    return f"give {kind(schema)}" + (f" ({about})" if about else "")


def kind(schema: Mapping[str, Any]) -> str:
    """Kind, choices and range of a value, in words."""
    if options := schema.get("anyOf") or schema.get("oneOf"):
        return " or ".join(kind(option) for option in options)
    if "enum" in schema:
        return "one of " + ", ".join(show(item) for item in schema["enum"])
    if "const" in schema:
        return show(schema["const"])
    types: str | list[str] = schema.get("type", "object")
    name = " or ".join(_TYPE_NAMES[name] for name in ([types] if isinstance(types, str) else types))
    return " ".join([name, " and ".join(_limits(schema))]).rstrip()


def _limits(schema: Mapping[str, Any]) -> list[str]:
    """Range of a number, or length and items of a list, each in words."""
    words = {
        "minimum": "at least",
        "exclusiveMinimum": "above",
        "maximum": "at most",
        "exclusiveMaximum": "below",
    }
    limits = [f"{word} {schema[bound]}" for bound, word in words.items() if bound in schema]
    few, many = schema.get("minItems"), schema.get("maxItems")
    if few is not None:
        limits.append(f"with {few} entries" if few == many else f"with at least {few} entries")
    items: list[Mapping[str, Any]] = [schema["items"]] if "items" in schema else schema.get("prefixItems", [])
    kinds = list(dict.fromkeys(kind(item) for item in items))
    return limits + [f"each {words}" for words in kinds[:1] if len(kinds) == 1]


def show(value: Any) -> str:
    """Write a value as it would stand in JSON, text in single quotes, cut after 60 characters."""
    text = f"'{value}'" if isinstance(value, str) else json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else text[:57] + "..."
