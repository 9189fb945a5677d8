"""What is generated from the models is current, and says of every key what it should."""

import pytest
import yaml
from jsonschema import Draft202012Validator
from settings_pages import documentation, editor_schema, generated_files, keys, yaml_defaults
from support import ROOT

from cccd.settings.root import whole_settings

KEYS = [key for key in keys() if not key.group]


@pytest.mark.parametrize("path", generated_files(ROOT), ids=lambda path: path.name)
def test_generated_files_are_current(path):
    """Run `PYTHONPATH=scripts python docs/settings_pages.py` when this fails."""
    assert path.read_text(encoding="utf-8") == generated_files(ROOT)[path]


def test_every_key_says_what_it_is_and_why():
    """Each complaint names its key."""
    wrong = []
    for key in KEYS:
        number = any(kind in str(key.schema) for kind in ("'number'", "'integer'"))
        what, why = key.schema["what"], key.schema["why"]
        complaints = {
            "what it is ends in a full stop": what.endswith(".") and not what.endswith("..."),
            "what it is stands nowhere": not what,
            "its reason is no sentence": not why.endswith(".") or len(why.split()) < 2,
            "a number needs a unit": number and not key.schema["unit"],
        }
        wrong += [f"{key.dotted}: {complaint}" for complaint, true in complaints.items() if true]
    assert wrong == []


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


def test_numbers_are_bounded():
    """Each single number has a range, on one side at least."""
    single = [key for key in KEYS if key.schema.get("type") in ("number", "integer")]
    assert [key.dotted for key in single if not list(limits(key.schema))] == []


def test_every_key_is_on_the_page_and_in_the_defaults():
    page = documentation([])
    held = yaml.safe_load(yaml_defaults())
    for key in KEYS:
        assert f"| `{key.dotted}` |" in page
        inside = held
        for name in key.path:
            inside = inside[name]
        assert inside == key.default, key.dotted


def test_editors_accept_the_defaults_and_refuse_what_the_models_refuse():
    schema = yaml.safe_load(editor_schema())
    Draft202012Validator.check_schema(schema)
    validator = Draft202012Validator(schema)
    assert validator.is_valid(yaml.safe_load(yaml_defaults()))
    assert validator.is_valid(whole_settings()().as_config())
    assert not validator.is_valid({"curves": {"tolerance": 1}})
    assert not validator.is_valid({"curves": {"k": 0}})


def measured(rows):
    """The last line of the page, of a key that was measured."""
    columns = [{"key": KEYS[-1].dotted, **row} for row in rows]
    return documentation(columns).splitlines()[-1]


def test_what_results_depend_on_stands_at_the_end():
    line = measured(
        {"factor": factor, "curve_distance_px": distance, "curve_control_points": points}
        for factor, distance, points in [("0.5", "0.11", "50"), ("1", "0.10", "50"), ("2", "0.05", "60")]
    )
    assert line == f"| `{KEYS[-1].dotted}` | distance +10.0 % | distance −50.0 %, points +20.0 % |"


def test_what_could_not_be_measured_is_left_empty():
    line = measured({"factor": factor, "curve_dice": dice} for factor, dice in [("1", "0.10"), ("2", "")])
    assert line == f"| `{KEYS[-1].dotted}` |  |  |"


def test_there_are_as_many_keys_as_a_user_can_read():
    assert len(KEYS) <= 76
