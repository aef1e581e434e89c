"""The border to OpenUSD: its Python library has no types, and only this module uses it.

A `UsdStage` is one file while it is written. Paths are those of prims, as `/Scene/mug`. Metres, kilograms, radians; z
is up.
"""

from __future__ import annotations

import itertools
import math
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdPhysics, UsdShade, Vt

from scenegen.things.mesh import Floats, Mesh
from scenegen.things.palette import RGB

# --------------------------------------------------------------------------------------------------------------------
# Principal axes of inertia, as USD wants them: three moments, and the rotation of their axes.


Quaternion = tuple[float, float, float, float]  # w, x, y, z
STILL: Quaternion = (1.0, 0.0, 0.0, 0.0)


def principal(moments: Floats) -> tuple[tuple[float, float, float], Quaternion]:
    """The principal moments of a symmetric matrix (3, 3), and the rotation from their axes to the matrix's.

    Of the 24 rotations that do it, the one closest to none: a matrix that is diagonal keeps its axes.
    """
    if not (moments - np.diag(np.diag(moments))).any():
        xx, yy, zz = np.diag(moments).tolist()
        return (xx, yy, zz), STILL
    values, vectors = np.linalg.eigh(moments)
    best, closest = -math.inf, np.eye(3)
    order: tuple[int, ...] = (0, 1, 2)
    for tried in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            turn = vectors[:, tried] * np.array(signs)
            near = round(float(np.trace(turn)), 9)  # ties are not decided by rounding
            if np.linalg.det(turn) > 0.0 and near > best:
                best, closest, order = near, turn, tried
    a, b, c = values[list(order)].tolist()
    return (a, b, c), _quaternion(closest)


def _quaternion(turn: Floats) -> Quaternion:
    """Of a rotation by less than 63 degrees, the most that `principal` needs."""
    w = math.sqrt(1.0 + float(np.trace(turn))) / 2.0
    x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    return w, float(x / (4.0 * w)), float(y / (4.0 * w)), float(z / (4.0 * w))


Triple = Sequence[float]
KEPT = "scenegen"  # the key of what we say in a prim's customData
CORNERS = [[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]]  # of a cube of size 1


class UsdStage:
    """A layer in memory, with a default prim. Nothing that it refers to is opened."""

    def __init__(self, root: str, kind: str, text: str = "") -> None:
        self._layer: Any = Sdf.Layer.CreateAnonymous(".usda")
        self._stage: Any = Usd.Stage.Open(self._layer)
        self._files: dict[str, str] = {}
        UsdGeom.SetStageUpAxis(self._stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(self._stage, 1.0)
        UsdPhysics.SetStageKilogramsPerUnit(self._stage, 1.0)
        self.xform(root, kind)
        self._stage.SetDefaultPrim(self._prim(root))
        if text:
            self._layer.documentation = text

    def _prim(self, path: str) -> Any:
        return self._stage.OverridePrim(path)

    # what is drawn

    def xform(self, path: str, kind: str = "") -> None:
        """A frame for what is below it."""
        prim = UsdGeom.Xform.Define(self._stage, path).GetPrim()
        if kind:
            Usd.ModelAPI(prim).SetKind(kind)

    def mesh(self, path: str, mesh: Mesh, normals: Floats | None = None) -> None:
        """Triangles; `normals` (3F, 3) are those of their corners."""
        made = UsdGeom.Mesh.Define(self._stage, path)
        points = _vectors(mesh.vertices)
        made.CreatePointsAttr(points)
        made.CreateFaceVertexCountsAttr(Vt.IntArray(len(mesh.faces), 3))
        made.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.faces.astype(np.int32).ravel()))
        made.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        made.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
        if normals is not None:
            made.CreateNormalsAttr(_vectors(normals.round(6)))
            made.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying)

    def places(self, path: str, places: Floats) -> None:
        """Where in a picture each corner of a mesh's triangles is, (3F, 2), v = 0 the lower edge."""
        kind, each = Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
        primvar = UsdGeom.PrimvarsAPI(self._prim(path)).CreatePrimvar("st", kind, each)
        primvar.Set(Vt.Vec2fArray.FromNumpy(places.astype(np.float32)))

    def box(self, path: str, center: Triple, sizes: Triple) -> None:
        """A box along the axes of what it is in."""
        made = UsdGeom.Cube.Define(self._stage, path)
        made.CreateSizeAttr(1.0)
        made.CreateExtentAttr(_vectors(np.array(CORNERS)))
        made.AddTranslateOp().Set(Gf.Vec3d(*_short(center)))
        made.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*_short(sizes)))

    def tint(self, path: str, color: RGB) -> None:
        """The colour in which programs without materials draw a mesh or box."""
        primvar = UsdGeom.PrimvarsAPI(self._prim(path)).CreatePrimvar(
            "displayColor", Sdf.ValueTypeNames.Color3fArray, UsdGeom.Tokens.constant
        )
        primvar.Set(_vectors(np.array([color])))

    def material(self, path: str, shader: str) -> None:
        """A material whose surface is that of UsdPreviewSurface, the prim `shader` below it; see `inputs`."""
        made = UsdShade.Material.Define(self._stage, path)
        surface = UsdShade.Shader.Define(self._stage, f"{path}/{shader}")
        surface.CreateIdAttr("UsdPreviewSurface")
        made.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")

    def inputs(self, shader: str, values: Mapping[str, float | RGB]) -> None:
        """Numbers and colours that a shader takes, here or in a file that is referred to."""
        types = Sdf.ValueTypeNames
        for name, value in values.items():
            kind, given = (types.Float, value) if isinstance(value, float) else (types.Color3f, Gf.Vec3f(*value))
            self._prim(shader).CreateAttribute(f"inputs:{name}", kind, custom=False).Set(given)

    def image(self, material: str, shader: str, file: str, color: RGB) -> None:
        """Let the colour of a material's surface, its prim `shader`, come from a picture, times `color`; it repeats,
        by the coordinates that `covered` gives a mesh."""
        reader, picture = f"{material}/coordinates", f"{material}/picture"
        st = UsdShade.Shader.Define(self._stage, reader)
        st.CreateIdAttr("UsdPrimvarReader_float2")
        st.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        made = UsdShade.Shader.Define(self._stage, picture)
        made.CreateIdAttr("UsdUVTexture")
        made.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(file))
        for side in ("wrapS", "wrapT"):
            made.CreateInput(side, Sdf.ValueTypeNames.Token).Set("repeat")
        made.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
        made.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*color, 1.0))
        made.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(st.ConnectableAPI(), "result")
        surface = UsdShade.Shader(self._stage.GetPrimAtPath(f"{material}/{shader}"))
        surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(made.ConnectableAPI(), "rgb")

    def quad(self, path: str, corners: Floats, coordinates: Floats) -> None:
        """A rectangle that is drawn on one side, that from which its corners (4, 3) are counter-clockwise, with
        `coordinates` (4, 2) in a texture."""
        made = UsdGeom.Mesh.Define(self._stage, path)
        points = _vectors(corners)
        made.CreatePointsAttr(points)
        made.CreateFaceVertexCountsAttr(Vt.IntArray([4]))
        made.CreateFaceVertexIndicesAttr(Vt.IntArray([0, 1, 2, 3]))
        made.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        made.CreateDoubleSidedAttr(False)
        made.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
        primvar = UsdGeom.PrimvarsAPI(made).CreatePrimvar(
            "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
        )
        primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(coordinates + 0.0, dtype=np.float32)))

    def bind(self, path: str, material: str, purpose: str = "") -> None:
        """Give a prim, and what is below it, a material; the purpose `physics` is for contacts."""
        binding = UsdShade.MaterialBindingAPI.Apply(self._prim(path))
        made = UsdShade.Material(self._stage.GetPrimAtPath(material))
        binding.Bind(made, UsdShade.Tokens.fallbackStrength, purpose or UsdShade.Tokens.allPurpose)

    def scope(self, path: str) -> None:
        """A place for materials."""
        UsdGeom.Scope.Define(self._stage, path)

    def guide(self, path: str) -> None:
        """A frame of things that are not drawn, unless somebody asks for guides."""
        UsdGeom.Xform.Define(self._stage, path).CreatePurposeAttr(UsdGeom.Tokens.guide)

    def light(self, path: str, *, intensity: float, angle: float, turns: Triple, color: RGB | None = None) -> None:
        """A light from far away: as bright as `intensity`, `angle` degrees wide; it shines down, turned about x, y and
        z, in this order, by degrees."""
        made = UsdLux.DistantLight.Define(self._stage, path)
        made.CreateIntensityAttr(intensity)
        if color is not None:
            made.CreateColorAttr(Gf.Vec3f(*color))
        made.CreateAngleAttr(angle)
        made.AddRotateXYZOp().Set(Gf.Vec3f(*turns))

    def camera(self, path: str, *, at: Triple, turn: float, lens: tuple[float, float, float]) -> None:
        """A camera that looks down, turned about x by degrees. `lens` is the focal length, and the width and height of
        the picture behind it, in millimetres."""
        made = self._camera(path, lens)
        made.AddTranslateOp().Set(Gf.Vec3d(*_short(at)))
        if turn:
            made.AddRotateXOp().Set(turn)

    def camera_by(self, path: str, view: Floats, lens: tuple[float, float, float]) -> None:
        """A camera whose `view` (4, 4) takes the world to its frame, in which it looks along -z and y is up."""
        place = np.linalg.inv(view).T  # USD multiplies rows from the left
        self._camera(path, lens).AddTransformOp().Set(Gf.Matrix4d(*place.ravel().tolist()))

    def _camera(self, path: str, lens: tuple[float, float, float]) -> Any:
        made = UsdGeom.Camera.Define(self._stage, path)
        focal, wide, high = lens
        made.CreateFocalLengthAttr(focal)
        made.CreateHorizontalApertureAttr(wide)
        made.CreateVerticalApertureAttr(high)
        made.CreateClippingRangeAttr(Gf.Vec2f(0.01, 1000.0))
        return made

    # what is simulated

    def gravity(self, path: str, magnitude: float) -> None:
        """The physics of the stage: gravity downwards, in m/s^2."""
        made = UsdPhysics.Scene.Define(self._stage, path)
        made.CreateGravityDirectionAttr(Gf.Vec3f(0.0, 0.0, -1.0))
        made.CreateGravityMagnitudeAttr(magnitude)

    def rigid(self, path: str, mass: float, center: Triple, moments: Triple, axes: Quaternion) -> None:
        """Make a frame a body that moves, of kilograms; the principal moments, in kg m^2, are about its centre of mass
        and the axes that `axes` turns."""
        prim = self._prim(path)
        UsdPhysics.RigidBodyAPI.Apply(prim)
        made = UsdPhysics.MassAPI.Apply(prim)
        made.CreateMassAttr(mass)
        made.CreateCenterOfMassAttr(Gf.Vec3f(*_clean(center)))
        made.CreateDiagonalInertiaAttr(Gf.Vec3f(*moments))
        made.CreatePrincipalAxesAttr(Gf.Quatf(*_clean(axes)))

    def held(self, path: str) -> None:
        """Undo `rigid` for a prim that refers to a body: what collides there cannot be moved."""
        prim = self._prim(path)
        prim.RemoveAPI(UsdPhysics.RigidBodyAPI)
        prim.RemoveAPI(UsdPhysics.MassAPI)

    def collider(self, path: str, contact: str, *, hull: bool) -> None:
        """Let a prim collide: a box as it is, or the convex hull of a mesh. `contact` is its material, see `contact`;
        not all programs would find that of a frame above."""
        self.bind(path, contact, "physics")
        prim = self._prim(path)
        UsdPhysics.CollisionAPI.Apply(prim)
        if hull:
            UsdPhysics.MeshCollisionAPI.Apply(prim).CreateApproximationAttr(UsdPhysics.Tokens.convexHull)

    def contact(self, path: str, friction: float, combine: str = "") -> None:
        """A material for contacts. `combine` is how PhysX makes one coefficient from those of two bodies; other
        programs ignore it. Without it, PhysX takes the mean."""
        prim = UsdShade.Material.Define(self._stage, path).GetPrim()
        made = UsdPhysics.MaterialAPI.Apply(prim)
        made.CreateStaticFrictionAttr(friction)
        made.CreateDynamicFrictionAttr(friction)
        made.CreateRestitutionAttr(0.0)
        if combine:
            prim.AddAppliedSchema("PhysxMaterialAPI")  # a schema of PhysX, which USD does not have
            name, kind = "physxMaterial:frictionCombineMode", Sdf.ValueTypeNames.Token
            prim.CreateAttribute(name, kind, custom=False, variability=Sdf.VariabilityUniform).Set(combine)

    # what refers to other files, and changes from scene to scene

    def refer(self, path: str, file: str) -> None:
        """A frame that takes all from the default prim of another file, and has a place: see `placed`."""
        made = UsdGeom.Xform.Define(self._stage, path)
        made.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
        made.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
        self._files[path] = file

    def known_as(self, path: str, name: str) -> None:
        """The name of an object that a prim is; programs show it where it is not the prim's."""
        prim = self._prim(path)
        prim.SetCustomData({KEPT: {"name": name}})
        if prim.GetName() != name:
            prim.SetDisplayName(name)

    def finished(self) -> UsdLayer:
        """The layer with its references. The stage is closed: it would look for the files."""
        del self._stage
        for path, file in self._files.items():
            self._layer.GetPrimAtPath(path).referenceList.Prepend(Sdf.Reference(file))
        return UsdLayer(self._layer)


class UsdLayer:
    """A layer that is complete but for what differs between scenes."""

    def __init__(self, layer: Any) -> None:
        self._layer = layer

    def place(self, path: str, at: Triple, turn: Quaternion) -> None:
        """Where a frame made by `UsdStage.refer` is."""
        self._place(self._layer.GetPrimAtPath(path), at, turn)

    def say(self, path: str, facts: Mapping[str, Any]) -> None:
        """What is known of a prim, in its customData; replaces what was said before."""
        self._layer.GetPrimAtPath(path).SetInfo("customData", {KEPT: dict(facts)})

    def variants(self, path: str, name: str) -> None:
        """A set of variants of a prim, which `variant` fills; the first is shown."""
        prim = self._layer.GetPrimAtPath(path)
        Sdf.VariantSetSpec(prim, name)
        prim.variantSetNameList.Prepend(name)

    def variant(
        self,
        path: str,
        among: str,
        name: str,
        facts: Mapping[str, Any],
        places: Mapping[str, tuple[Triple, Quaternion]],
    ) -> None:
        """One of the variants: the places of frames below, by their names, and what is known of it."""
        prim = self._layer.GetPrimAtPath(path)
        with Sdf.ChangeBlock():
            made = Sdf.VariantSpec(prim.variantSets[among], name).primSpec
            made.SetInfo("customData", {KEPT: dict(facts)})
            for child, (at, turn) in places.items():
                self._place(Sdf.PrimSpec(made, child, Sdf.SpecifierOver), at, turn)
        if among not in prim.variantSelections:
            prim.variantSelections[among] = name

    def text(self) -> bytes:
        """As a .usda file."""
        data: str = self._layer.ExportToString()
        return data.encode()

    def _place(self, spec: Any, at: Triple, turn: Quaternion) -> None:
        values = (
            ("xformOp:translate", Sdf.ValueTypeNames.Double3, Gf.Vec3d(*_clean(at))),
            ("xformOp:orient", Sdf.ValueTypeNames.Quatd, Gf.Quatd(*_clean(turn))),
        )
        for name, kind, value in values:
            found = spec.attributes.get(name) or Sdf.AttributeSpec(spec, name, kind)
            found.default = value


def crate(text: bytes) -> bytes:
    """The binary form (.usdc) of a .usda file."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(text.decode())
    with tempfile.TemporaryDirectory() as folder:  # the library writes crates to files only
        path = Path(folder) / "scene.usdc"
        layer.Export(str(path))
        return path.read_bytes()


def _clean(values: Triple) -> list[float]:
    """Without negative zeros."""
    return [value + 0.0 for value in values]


def _short(values: Triple) -> list[float]:
    """With nine digits, enough for boxes."""
    return [float(f"{value + 0.0:.9g}") for value in values]


def _vectors(rows: Floats) -> Any:
    """(n, 3) in single precision, as USD has points, normals and colours."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(rows + 0.0, dtype=np.float32))
