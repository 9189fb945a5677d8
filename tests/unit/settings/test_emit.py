"""What is generated from the models is current, and says of every key what it should."""

from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator

from cccd.errors import InputError
from cccd.settings.emit import documentation, editor_schema, generated_files, keys, yaml_defaults
from cccd.settings.root import Settings
from cccd.settings.validation import validate_config

ROOT = Path(__file__).resolve().parents[3]
KEYS = [key for key in keys() if not key.group]


@pytest.mark.parametrize("path", generated_files(ROOT), ids=lambda path: path.name)
def test_generated_files_are_current(path):
    """Run `PYTHONPATH=scripts python -m cccd.settings` when this fails."""
    assert path.read_text(encoding="utf-8") == generated_files(ROOT)[path]


@pytest.mark.parametrize("key", KEYS, ids=lambda key: key.dotted)
def test_every_key_says_what_it_is_and_why(key):
    assert key.what
    assert key.what.endswith("...") or not key.what.endswith(".")
    assert key.why.endswith(".")
    assert len(key.why.split()) >= 2
    numeric = any(kind in str(key.schema) for kind in ("'number'", "'integer'"))
    assert key.unit or not numeric, "a number needs a unit"


def limits(schema):
    """Every (bound, value) in a schema, wherever in it."""
    if isinstance(schema, dict):
        for name, part in schema.items():
            if name in ("minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum"):
                yield name, part
            yield from limits(part)
    elif isinstance(schema, list):
        for part in schema:
            yield from limits(part)


def configured(path, value):
    for name in reversed(path):
        value = {name: value}
    return value


@pytest.mark.parametrize("key", [key for key in KEYS if "type" in key.schema], ids=lambda key: key.dotted)
def test_ranges_hold(key):
    """A number just outside its range is refused, the bound itself only where it belongs to the range."""
    if key.schema["type"] not in ("number", "integer"):
        return
    for bound, value in limits(key.schema):
        sign = 1 if "aximum" in bound else -1
        with pytest.raises(InputError, match=key.path[-1]):
            validate_config(configured(key.path, value + sign))
        if bound.startswith("exclusive"):
            with pytest.raises(InputError, match=key.path[-1]):
                validate_config(configured(key.path, value))
        else:
            validate_config(configured(key.path, value))


def test_numbers_are_bounded():
    """Each single number has a range, on one side at least."""
    single = [key for key in KEYS if key.schema.get("type") in ("number", "integer")]
    assert [key.dotted for key in single if not list(limits(key.schema))] == []


def test_expert_keys_are_on_the_page_and_not_in_the_defaults():
    page = documentation([])
    held = yaml.safe_load(yaml_defaults())
    for key in KEYS:
        assert f"| `{key.dotted}` |" in page
        inside = held
        for name in key.path:
            inside = inside.get(name, {}) if isinstance(inside, dict) else {}
        assert (inside == {}) == key.expert, key.dotted


def test_defaults_stay_readable():
    assert max(len(line) for line in yaml_defaults().splitlines()) <= 130


def test_editors_accept_the_defaults_and_refuse_what_the_models_refuse():
    schema = yaml.safe_load(editor_schema())
    Draft202012Validator.check_schema(schema)
    validator = Draft202012Validator(schema)
    assert validator.is_valid(yaml.safe_load(yaml_defaults()))
    assert validator.is_valid(Settings().as_config())
    assert not validator.is_valid({"curves": {"tolerance": 1}})
    assert not validator.is_valid({"curves": {"k": 0}})


def test_sensitivity_stands_beside_its_key():
    expert = [key.dotted for key in KEYS if key.expert]
    if not expert:
        pytest.skip("no expert keys yet")
    rows = [
        {"key": expert[0], "factor": factor, "assd_mm": assd, "control_points": points}
        for factor, assd, points in [("0.5", "0.11", "50"), ("1", "0.10", "50"), ("2", "0.05", "60")]
    ]
    (line,) = [line for line in documentation(rows).splitlines() if line.startswith(f"| `{expert[0]}` |")]
    assert line.endswith("| ASSD +10.0 % | ASSD −50.0 %, points +20.0 % |")


def test_what_could_not_be_measured_is_left_empty():
    key = next(key.dotted for key in KEYS if key.expert)
    rows = [{"key": key, "factor": factor, "assd_mm": assd} for factor, assd in [("1", "0.10"), ("2", "")]]
    (line,) = [line for line in documentation(rows).splitlines() if line.startswith(f"| `{key}` |")]
    assert line.endswith("|  |  |")
