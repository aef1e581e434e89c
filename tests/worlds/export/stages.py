"""USD stages for tests: opened by USD's own library, with its rules and its reader of physics."""

import math

import numpy as np
import pytest

pxr = pytest.importorskip("pxr", reason="usd-core is not installed (pip install 'scenegen-dsl[usd]')")
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade, UsdValidation  # noqa: E402


def opened(path, variant=None):
    """A stage, of which one scene is shown."""
    stage = Usd.Stage.Open(str(path))
    if variant is not None:
        stage.SetEditTarget(stage.GetSessionLayer())  # layers are shared: the file is left as it is
        stage.GetDefaultPrim().GetVariantSet("scene").SetVariantSelection(variant)
    return stage


def faults(stage):
    """What USD's own rules, all of them, find in a stage."""
    rules = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(rules) >= 25
    return [fault.GetErrorAsString() for fault in UsdValidation.ValidationContext(rules).Validate(stage)]


def things(stage):
    """The objects of a scene, by name."""
    named = [(prim.GetCustomDataByKey("scenegen:name"), prim) for prim in stage.GetDefaultPrim().GetChildren()]
    found = {name: prim for name, prim in named if name is not None}
    assert len(found) == len(named) - 1  # but for the table
    return found


def frame(prim):
    """(4, 4) from a prim's frame to the world's, for columns."""
    return np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim)).T


def poses(stage, names):
    """x, y, z, theta of objects that stand upright."""
    found = []
    for name in names:
        turn = frame(things(stage)[name])
        np.testing.assert_allclose(turn[2], [0, 0, 1, turn[2, 3]], atol=1e-15)
        found.append([*turn[:3, 3], math.atan2(turn[1, 0], turn[0, 0]) % math.tau])
    return np.array(found)


def corners(prim):
    """(V, 3): the points of a mesh, or the corners of a cube, in the world's frame."""
    if prim.IsA(UsdGeom.Cube):
        half = UsdGeom.Cube(prim).GetSizeAttr().Get() / 2.0
        points = half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    else:
        points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get())
    turn = frame(prim)
    return points @ turn[:3, :3].T + turn[:3, 3]


def physics(stage):
    """What USD's reader of physics finds: kind -> path -> description."""
    found = {}
    for kind, (paths, descriptions) in UsdPhysics.UsdPhysicsLoadStageFromPrimRange(stage, ["/"]).items():
        found[str(kind).rpartition(".")[2]] = {str(path): one for path, one in zip(paths, descriptions, strict=True)}
    return found


def friction(stage, material):
    """Static and dynamic."""
    made = UsdPhysics.MaterialAPI(stage.GetPrimAtPath(str(material)))
    return made.GetStaticFrictionAttr().Get(), made.GetDynamicFrictionAttr().Get()


def rotation(w, x, y, z):
    """(3, 3), of a quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def inertia(prim):
    """Mass, centre of mass (3,) and the moments (3, 3) about it, along the prim's axes."""
    made = UsdPhysics.MassAPI(prim)
    axes = made.GetPrincipalAxesAttr().Get()
    turn = rotation(axes.GetReal(), *axes.GetImaginary())
    moments = turn @ np.diag(made.GetDiagonalInertiaAttr().Get()) @ turn.T
    return made.GetMassAttr().Get(), np.array(made.GetCenterOfMassAttr().Get()), moments


def color(prim):
    """What a part is drawn in: by its material, and without."""
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    shader = material.ComputeSurfaceSource()[0]
    (tint,) = UsdGeom.PrimvarsAPI(prim).GetPrimvar("displayColor").Get()
    return tuple(shader.GetInput("diffuseColor").Get()), tuple(tint)
