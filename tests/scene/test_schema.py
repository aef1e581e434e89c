"""The JSON Schema of scene files, held still: whoever reads our files in another language relies on it."""

import json

from scenegen.scenes.data import SceneFile


def schema():
    return json.dumps(SceneFile.model_json_schema(), indent=1) + "\n"


def test_schema(golden, root, request):
    golden("scene/scenes.schema.json", schema())
    shipped = root / "docs" / "scenes.schema.json"
    if request.config.getoption("--regenerate"):
        shipped.write_text(schema(), encoding="utf-8")
    assert shipped.read_text(encoding="utf-8") == schema()


def test_the_documented_example_is_valid(root):
    """Every field of the documented example by name; `labels` stands in files without scenes."""
    properties = SceneFile.model_json_schema()["properties"]
    assert list(properties) == [
        "format", "version", "spec", "workspace", "objects", "counts", "regions", "sampler", "request", "labels",
        "scenes",
    ]  # fmt: skip
