"""Scene data: what the models of scene files let in, and the workspace. Footprints of scene files: the corners of a
polygon are convex and counter-clockwise, or the file is refused. The JSON Schema of scene files, held still:
whoever reads our files in another language relies on it.
"""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from scenegen.geometry import Box, Circle, Polygon
from scenegen.geometry.workspace import Workspace
from scenegen.pose import TWO_PI
from scenegen.scenes.data import (
    BoxFootprint,
    CircleFootprint,
    PolygonFootprint,
    Pose,
    RequestData,
    SceneData,
    SceneFile,
    ShapeData,
    SpecRef,
    footprint_data,
    footprint_of,
)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "left", None, [1.0]])
@pytest.mark.parametrize("axis", ["x", "y", "theta"])
def test_poses_are_finite_numbers(axis, value):
    with pytest.raises(ValidationError):
        Pose(**({"x": 0.0, "y": 0.0, "theta": 0.0} | {axis: value}))


def test_nothing_extra_and_nothing_changes():
    with pytest.raises(ValidationError):
        Pose(x=0, y=0, theta=0, z=0)
    with pytest.raises(ValidationError):
        Pose(x=0, y=0, theta=0).x = 1
    with pytest.raises(ValidationError):
        SceneData(poses={}, phi={"task": math.nan})


def test_footprints_are_told_apart_by_kind():
    box = ShapeData.model_validate(
        {"asset": "knife", "footprint": {"kind": "box", "length": 0.2, "width": 0.02}, "height": 0.01}
    )
    assert box.footprint == BoxFootprint(length=0.2, width=0.02)
    for bad in ({"kind": "circle", "length": 1.0}, {"kind": "blob"}, {"kind": "circle", "radius": 0.0}):
        with pytest.raises(ValidationError):
            ShapeData.model_validate({"asset": "x", "footprint": bad, "height": 0.1})
    with pytest.raises(ValidationError):
        ShapeData(asset="x", footprint=CircleFootprint(radius=0.1), height=-1.0)


def test_references_and_requests():
    with pytest.raises(ValidationError):
        SpecRef(source="x", sha256="ABC")
    with pytest.raises(ValidationError):
        RequestData(phi={}, n=0)
    assert RequestData(phi={"task": (None, 0.5)}, n=1).spread == "flat"


EDGES = st.floats(-5, 5)


@given(EDGES, EDGES, st.floats(-10, 10))
def test_a_workspace_contains_its_edges_and_nothing_beyond(x, y, theta):
    space = Workspace((-2.0, 1.0), (0.5, 3.0))
    inside = -2 <= x <= 1 and 0.5 <= y <= 3 and 0 <= theta < TWO_PI
    rows = np.array([[x, 0.0], [y, 1.0], [theta, 0.0]])
    assert space.contains(rows).tolist() == [inside, True]


def test_one_object_outside_is_a_scene_outside():
    space = Workspace()
    rows = np.array([[0.0, 0.5, 0.5], [1.0, 0.5, 0.5], [0.0, 0.0, 0.0], [1.0, 1.1, math.nan], [0.0] * 3, [0.0] * 3])
    assert space.contains(rows).tolist() == [True, False, False]
    low, high = space.box(2)
    assert low.tolist() == [0.0] * 6 and high.tolist() == [1.0, 1.0, TWO_PI] * 2
    assert (Workspace((-1.0, 2.0), (3.0, 3.5)).width, Workspace((-1.0, 2.0), (3.0, 3.5)).height) == (3.0, 0.5)


@pytest.mark.parametrize("footprint", [Circle(0.1), Box(0.1, 1 / 3), Polygon(((0.0, 0.0), (0.1, 1e-17), (1 / 3, 0.2)))])
def test_a_footprint_reads_back_bit_for_bit(footprint):
    data = footprint_data(footprint)
    assert footprint_of(type(data).model_validate_json(data.model_dump_json())) == footprint


STAR = [(math.cos(math.tau * 2 * k / 5), math.sin(math.tau * 2 * k / 5)) for k in range(5)]


@pytest.mark.parametrize(
    "corners",
    [
        [(0, 0), (0, 1), (1, 0)],
        [(0, 0), (1, 0), (0.1, 0.1), (0, 1)],
        [(0, 0), (1, 0), (2, 0)],
        [(0, 0), (0, 0), (0, 0)],
        STAR,
    ],
    ids=["clockwise", "not convex", "on a line", "a point", "a star"],
)
def test_other_corners_are_refused(corners):
    with pytest.raises(ValidationError, match="convex polygon, counter-clockwise"):
        PolygonFootprint(vertices=[(float(x), float(y)) for x, y in corners])


def schema():
    return json.dumps(SceneFile.model_json_schema(), indent=1) + "\n"


def test_schema(derived):
    derived("docs/scenes.schema.json", schema())


def test_the_documented_example_is_valid(root):
    """Every field of the documented example by name; `labels` stands in files without scenes."""
    properties = SceneFile.model_json_schema()["properties"]
    assert list(properties) == [
        "format", "version", "spec", "workspace", "objects", "counts", "regions", "sampler", "request", "labels",
        "scenes",
    ]  # fmt: skip
