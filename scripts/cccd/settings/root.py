"""The whole configuration: hold one against the models, and say what is wrong with it in one line."""

from __future__ import annotations

import functools
import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any, Literal, cast, get_args

from pydantic import ValidationError, create_model
from pydantic.fields import FieldInfo

from cccd.errors import InputError, nearest
from cccd.plugins import find, table
from cccd.settings import Section, setting
from cccd.settings.curves import CurveSettings
from cccd.settings.imports import ImportSettings
from cccd.settings.junctions import BoundarySettings, JunctionSettings
from cccd.settings.surface import LoftSettings


class Settings(Section):
    """All settings, section by section; what is not given has its default.

    The sections are ``import_`` (``import`` in YAML), ``boundaries``, ``gnn``, ``curves``,
    ``surface`` and ``report``. docs/configuration.md has every key with its unit, range and reason.

    Examples
    --------
    >>> Settings(surface={"smallest_part_voxels": 20}).surface.smallest_part_voxels
    20.0
    """

    if not TYPE_CHECKING:  # whose checkers see the fields

        def __init__(self, **sections: Any) -> None:
            """Check the sections.

            Raises
            ------
            InputError
                Names the key, what is wrong with it, and a hint.
            """
            try:
                super().__init__(**sections)
            except ValidationError as error:
                raise explain(error, sections) from None

    cohort: str = setting(
        "config/cohort.tsv",
        "one row per structure",
        why="Relative to where the command was typed, or to the project's root; or absolute.",
    )
    seed: int = setting(
        152,
        "everything random is drawn from it",
        why="Equal seeds give equal bytes.",
        unit="1",
        ge=0,
        le=2**32 - 1,
    )
    train: Literal["auto"] | bool = setting(
        "auto",
        "true: train the junction network; false: take a ready one; auto: train for the default cohort",
        why="Other cohorts take the shipped model, or the one that gnn.pretrained names.",
    )
    compare: Literal["auto"] | bool = setting(
        "auto",
        "true: compare with other methods and the paper; false: do not; auto: compare the default cohort",
        why="Comparisons take several times as long as the surfaces. With auto those for a closer look, and "
        "the longest of all but each case's first structure, are left to the target evidence.",
    )
    device: Literal["auto", "cpu", "cuda"] = setting(
        "auto",
        "where networks are trained and used",
        why="auto: on a GPU if torch finds one. A change repeats no finished job.",
    )
    segmenter: str | None = setting(
        None,
        "what makes masks: a network (nnunet, ...), a file of weights, totalsegmentator; null: nothing",
        why="Without one a threshold finds the organ (import.region). A network (nnunet, polar_unet, "
        "kiunet_3d, h_denseunet, unet_3plus) is trained on the sheet's rows of role train; nnunetv2:FOLDER "
        "calls nnU-Net's own command with a model that it trained.",
    )
    import_: ImportSettings = setting(
        ImportSettings(),
        "from a row of the sheet to one cropped structure",
        why="Scans come in many ways.",
        alias="import",
    )
    boundaries: BoundarySettings = setting(
        BoundarySettings(), "from slices to boundary pixels", why="Section 4.3, Algorithm 1."
    )
    gnn: JunctionSettings = setting(
        JunctionSettings(), "the network that orders boundary pixels", why="Equation 11."
    )
    curves: CurveSettings = setting(
        CurveSettings(), "ordered curves, their corners and splines", why="Definitions 3 and 4."
    )
    surface: LoftSettings = setting(
        LoftSettings(), "from curves to a closed surface", why="What all the rest is for."
    )


@functools.cache
def whole_settings() -> type[Settings]:
    """Join the sections that other packages add (`cccd.plugins`) to the configuration's model."""
    sections = {name: find(path) for name, path in table("SETTINGS").items()}
    return create_model("Settings", __base__=Settings, **sections)


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
    import yaml  # for files alone

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
        From `Settings`.
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
