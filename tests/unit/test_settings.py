import math
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from cccd.errors import InputError
from cccd.settings import nearest, validate_config

ROOT = Path(__file__).resolve().parents[2]

SCHEMA = """
type: object
additionalProperties: false
required: [seed, curves]
properties:
  seed: {type: integer, minimum: 0, description: Everything random is drawn from it.}
  curves:
    type: object
    additionalProperties: false
    required: [k]
    properties:
      k: {type: integer, minimum: 1, maximum: 50}
      detector: {type: string, enum: [cosine, chord]}
      smoothing: {anyOf: [{type: number, exclusiveMinimum: 0}, {type: 'null'}]}
      sweep: {type: array, items: {type: integer}, minItems: 1}
"""


@pytest.fixture(scope="module")
def schema(tmp_path_factory):
    path = tmp_path_factory.mktemp("schema") / "config.schema.yaml"
    path.write_text(SCHEMA)
    return path


GOOD = {"seed": 1, "curves": {"k": 5, "detector": "chord", "smoothing": None, "sweep": [1]}}


def test_good_configuration_passes(schema):
    validate_config(GOOD, schema)


def test_default_configuration_passes():
    config = yaml.safe_load((ROOT / "config" / "config.yaml").read_text())
    validate_config(config, ROOT / "workflow" / "schemas" / "config.schema.yaml")


@pytest.mark.parametrize(
    ("curves", "expected"),
    [
        ({"k": 0}, ["config key curves.k", "0", "at least 1 and at most 50"]),
        ({"k": 2.5}, ["config key curves.k", "2.5", "whole number"]),
        ({"k": True}, ["config key curves.k", "true"]),
        ({"k": "1e1"}, ["config key curves.k", "'1e1'", "YAML reads this as text"]),
        ({"k": None}, ["config key curves.k", "null", "keep the default"]),
        ({"k": math.nan}, ["config key curves.k", "nan"]),
        ({"kk": 5}, ["config key curves.kk", "unknown", "did you mean 'k'?"]),
        ({"k": 5, "detektor": "cosine"}, ["config key curves.detektor", "did you mean 'detector'?"]),
        ({"k": 5, "detector": "cosin"}, ["config key curves.detector", "did you mean 'cosine'?"]),
        ({"k": 5, "detector": "zzz"}, ["config key curves.detector", "'cosine', 'chord'"]),
        ({"k": 5, "smoothing": -1}, ["config key curves.smoothing", "-1", "above 0 or null"]),
        ({"k": 5, "sweep": []}, ["config key curves.sweep", "at least 1 entries"]),
        ({"k": 5, "sweep": [1, "x"]}, ["config key curves.sweep.1", "'x'"]),
        ({}, ["config key curves.k", "missing"]),
        (None, ["config key curves", "null"]),
        ([1], ["config key curves", "[1]"]),
    ],
)
def test_bad_value_names_key_value_and_cure(schema, curves, expected):
    with pytest.raises(InputError) as caught:
        validate_config({**GOOD, "curves": curves}, schema)
    for part in expected:
        assert part in str(caught.value)


def test_near_name_is_found_whatever_the_case():
    assert nearest("Spleen", ["liver", "spleen"]) == "did you mean 'spleen'?"
    assert nearest("qqq", ["liver", "spleen"]) == "choose one of liver, spleen"


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@given(
    st.dictionaries(st.sampled_from(["seed", "curves", "x"]), values | st.just(GOOD["curves"]), max_size=3)
)
def test_anything_is_accepted_or_refused_in_one_line(schema, config):
    try:
        validate_config(config, schema)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        assert set(config) == {"seed", "curves"}
        assert config["seed"] >= 0
