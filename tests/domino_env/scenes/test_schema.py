"""The JSON Schema of scene files: up to date, named by shipped scenes, as strict as the reader."""

import json
import tomllib

import jsonschema
import pytest

import domino_env as de
from domino_env.core.results import revision, versions
from domino_env.scenes.io.reading import DISTRIBUTIONS, SCHEMA, scene_from_document

SHIPPED = sorted([*SCHEMA.parent.glob("*.toml"), *DISTRIBUTIONS.glob("*.toml")])
KEPT = json.loads(SCHEMA.read_text("utf-8"))
VALIDATOR = jsonschema.Draft202012Validator(KEPT)


def test_the_shipped_schema_is_up_to_date(script):
    made = script("docs/shipped_scenes.py").scene_schema()
    assert made == KEPT, "run `python docs/shipped_scenes.py`"
    jsonschema.Draft202012Validator.check_schema(KEPT)


def test_the_revision_of_the_environments_is_up_to_date(script):
    """It differs if scenes, observations or rewards do, and then earlier results do not compare."""
    made = script("docs/shipped_scenes.py").compute_revision()
    assert made == revision() == versions()["revision"], "run `python docs/shipped_scenes.py`"


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_files_name_the_schema_and_are_valid(path):
    text = path.read_text("utf-8")
    folder = "./" if path.parent == SCHEMA.parent else "../shipped/"
    assert text.startswith(f"#:schema {folder}{SCHEMA.name}\n")
    VALIDATOR.validate(tomllib.loads(text))
    if path.parent == SCHEMA.parent:
        VALIDATOR.validate(de.load_scene(path).document())


def sprint(**tables):
    return de.load_scene("sprint").document() | tables


@pytest.mark.parametrize(
    "document",
    [
        sprint(spaceing={"fixed": 0.01}),
        sprint(spacing={"min": 0.01}),
        sprint(spacing={"min": 0.01, "max": 0.02, "of": "width"}),
        sprint(stock={"thickness": [0.0075], "count": [40]}),
        sprint(row={"count": 1}),
        sprint(limits={}),
        sprint(objective="tempo", tempo={"from": 1.0}),
        sprint(name="a/b"),
        sprint(title="a\nb"),
    ],
    ids=range(9),
)
def test_the_reader_rejects_what_the_schema_rejects(document):
    assert not VALIDATOR.is_valid(document)
    with pytest.raises(ValueError, match=r"bad\.toml: "):
        scene_from_document(document, "bad", "bad.toml")
