"""Scenes as USD (https://openusd.org), with the physics of UsdPhysics.

A scene's file has `/Scene`, its default prim, with the table and every object, a rigid body of its own frame: in the
middle of its footprint at its lowest point. Objects refer to `meshes/NAME.usda`, where each form is once, with mass,
contacts, meshes that are drawn and convex pieces that collide; a scene adds places and colours. Objects that are held
in place are colliders without a body. What a user who refers to the scene has already is outside of the default prim,
in `/Environment`: gravity, lights, cameras and a floor.

Files of a scene each are text, to be read and compared. A file with all scenes has each as a variant of the set
`scene`: time samples would make rigid bodies follow an animation.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdPhysics, UsdShade, Vt

from scenegen.things.library import RGB
from scenegen.things.mesh import Mesh, shade_mesh
from scenegen.things.outline import Floats, Indices
from scenegen.worlds.export.looks import SceneLook, TexturedColor, Wall
from scenegen.worlds.export.world import TALL, TEXTURES, WOODEN, Body, BodyForm, Quaternion, World, principal
from scenegen.worlds.export.xml import check_room

Triple = Sequence[float]
MATERIALS, SHADER = "Looks", "surface"  # names of prims
CUSTOM_KEY = "scenegen"  # the key of what we say in a prim's customData
CUBE_CORNERS = [[-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]]  # of a cube of size 1


class UsdStage:
    """The border to OpenUSD, whose Python library has no types: one file while it is written, with a default prim.
    Nothing that it refers to is opened. Paths are those of prims, as `/Scene/mug`. Metres, kilograms, radians; z is
    up."""

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
        made = self._mesh(path, mesh.vertices, mesh.faces)
        if normals is not None:
            made.CreateNormalsAttr(_vectors(normals.round(6)))
            made.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying)

    def places(self, path: str, places: Floats, each: str = UsdGeom.Tokens.faceVarying) -> None:
        """Where in a picture each corner of a mesh's triangles is, (3F, 2), or each vertex; v = 0 the lower edge."""
        primvar = UsdGeom.PrimvarsAPI(self._prim(path)).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, each)
        primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(places, dtype=np.float32)))

    def box(self, path: str, center: Triple, sizes: Triple) -> None:
        """A box along the axes of what it is in."""
        made = UsdGeom.Cube.Define(self._stage, path)
        made.CreateSizeAttr(1.0)
        made.CreateExtentAttr(_vectors(np.array(CUBE_CORNERS)))
        made.AddTranslateOp().Set(Gf.Vec3d(*_short(center)))
        made.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*_short(sizes)))

    def tint(self, path: str, color: RGB) -> None:
        """The colour in which programs without materials draw a mesh or box."""
        primvar = UsdGeom.PrimvarsAPI(self._prim(path)).CreatePrimvar(
            "displayColor", Sdf.ValueTypeNames.Color3fArray, UsdGeom.Tokens.constant
        )
        primvar.Set(_vectors(np.array([color])))

    def material(self, path: str) -> None:
        """A material whose surface is that of UsdPreviewSurface, the prim `SHADER` below it; see `inputs`."""
        made = UsdShade.Material.Define(self._stage, path)
        surface = UsdShade.Shader.Define(self._stage, f"{path}/{SHADER}")
        surface.CreateIdAttr("UsdPreviewSurface")
        made.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")

    def inputs(self, material: str, values: Mapping[str, float | RGB]) -> None:
        """Numbers and colours that a material's surface takes, here or in a file that is referred to."""
        types = Sdf.ValueTypeNames
        for name, value in values.items():
            kind, given = (types.Float, value) if isinstance(value, float) else (types.Color3f, Gf.Vec3f(*value))
            self._prim(f"{material}/{SHADER}").CreateAttribute(f"inputs:{name}", kind, custom=False).Set(given)

    def image(self, material: str, file: str, color: RGB) -> None:
        """Let the colour of a material's surface come from a picture, times `color`; it repeats,
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
        surface = UsdShade.Shader(self._stage.GetPrimAtPath(f"{material}/{SHADER}"))
        surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(made.ConnectableAPI(), "rgb")

    def quad(self, path: str, corners: Floats, coordinates: Floats) -> None:
        """A rectangle that is drawn on one side, that from which its corners (4, 3) are counter-clockwise, with
        `coordinates` (4, 2) in a texture."""
        self._mesh(path, corners, np.array([[0, 1, 2, 3]])).CreateDoubleSidedAttr(False)
        self.places(path, coordinates + 0.0, UsdGeom.Tokens.vertex)

    def _mesh(self, path: str, vertices: Floats, faces: Indices) -> Any:
        """Faces (F, K) of K corners each."""
        made = UsdGeom.Mesh.Define(self._stage, path)
        points = _vectors(vertices)
        made.CreatePointsAttr(points)
        made.CreateFaceVertexCountsAttr(Vt.IntArray(len(faces), faces.shape[1]))
        made.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.astype(np.int32).ravel()))
        made.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        made.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
        return made

    def bind(self, path: str, material: str, purpose: str = "") -> None:
        """Give a prim, and what is below it, a material; the purpose `physics` is for contacts."""
        binding = UsdShade.MaterialBindingAPI.Apply(self._prim(path))
        made = UsdShade.Material(self._stage.GetPrimAtPath(material))
        binding.Bind(made, UsdShade.Tokens.fallbackStrength, purpose or UsdShade.Tokens.allPurpose)

    def materials(self, root: str) -> str:
        """The place for the materials of what is below `root`."""
        UsdGeom.Scope.Define(self._stage, f"{root}/{MATERIALS}")
        return f"{root}/{MATERIALS}"

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

    def hold(self, path: str) -> None:
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
        prim.SetCustomData({CUSTOM_KEY: {"name": name}})
        if prim.GetName() != name:
            prim.SetDisplayName(name)

    def finish(self) -> None:
        """The file gets its references, and is complete but for what differs between scenes: what is below. The stage
        is closed: it would look for the files."""
        del self._stage
        for path, file in self._files.items():
            self._layer.GetPrimAtPath(path).referenceList.Prepend(Sdf.Reference(file))

    def place(self, path: str, at: Triple, turn: Quaternion) -> None:
        """Where a frame made by `UsdStage.refer` is."""
        self._place(self._layer.GetPrimAtPath(path), at, turn)

    def say(self, path: str, facts: Mapping[str, Any]) -> None:
        """What is known of a prim, in its customData; replaces what was said before."""
        self._layer.GetPrimAtPath(path).SetInfo("customData", {CUSTOM_KEY: dict(facts)})

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
            made.SetInfo("customData", {CUSTOM_KEY: dict(facts)})
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


FOCUS, CAMERA_RATIO = 24.0, 16.0 / 9.0  # mm; width to height of pictures
CAMERA_FIELD = 45.0  # degrees, from the lower edge of a picture to the upper
# Degrees about x and y. The sun is as bright as a new light in Isaac Sim; the other one brightens its shadows.
SUN, FILL = (3000.0, 25.0, -25.0), (1000.0, -35.0, 40.0)
LIGHT_ANGLE = 1.0  # degrees: the width of both
USUAL_SUN, USUAL_FILL = 0.46, 0.60  # intensity and ambient light of a look that are as bright as these


def material(stage: UsdStage, root: str, name: str, color: RGB) -> None:
    """A material below `root`, for `cover`: as rough as a table, and no metal."""
    path = f"{root}/{MATERIALS}/{name}"
    stage.material(path)
    stage.inputs(path, {"diffuseColor": color, "roughness": 0.6, "metallic": 0.0})


def cover(stage: UsdStage, root: str, part: str, name: str, color: RGB) -> None:
    """Give `part`, a mesh or box below `root`, a material of this colour."""
    stage.bind(part, f"{root}/{MATERIALS}/{name}")
    stage.tint(part, color)


def recolor(stage: UsdStage, root: str, part: str, name: str, color: RGB) -> None:
    """Another colour for a part and its material, which are in the file that `root` refers to."""
    stage.inputs(f"{root}/{MATERIALS}/{name}", {"diffuseColor": color})
    stage.tint(part, color)


def covering(stage: UsdStage, root: str, name: str, what: TexturedColor) -> None:
    """A material below `root` for a rectangle of `cover_rectangle`."""
    material(stage, root, name, what.color)
    if what.file:
        stage.image(f"{root}/{MATERIALS}/{name}", f"./{TEXTURES}/{what.file}", what.color)


def cover_rectangle(stage: UsdStage, root: str, part: str, name: str, wall: Wall, what: TexturedColor) -> None:
    """A rectangle, with a material of `covering`."""
    across, up, middle = (np.array(one) for one in (wall.across, wall.up, wall.middle))
    sides = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) / 2.0
    corners = middle + sides[:, :1] * wall.width * across + sides[:, 1:] * wall.height * up
    stage.quad(part, corners, (sides + 0.5) * what.repeats(wall.width, wall.height))
    cover(stage, root, part, name, what.mean)


def lights(stage: UsdStage, root: str, dressed: SceneLook | None) -> None:
    """A sun, and a weaker light from the other side."""
    if dressed is None:
        for name, (intensity, about_x, about_y) in (("sun", SUN), ("fill", FILL)):
            stage.light(f"{root}/{name}", intensity=intensity, angle=LIGHT_ANGLE, turns=(about_x, about_y, 0.0))
        return
    look = dressed.look
    x, y, z = look.towards
    # Turned about x and then y, what shines along -z shines along -towards.
    turns = (-math.degrees(math.atan2(y, math.hypot(x, z))), math.degrees(math.atan2(x, z)), 0.0)
    strength = SUN[0] * look.light_intensity / USUAL_SUN
    stage.light(f"{root}/sun", intensity=strength, angle=LIGHT_ANGLE, turns=turns, color=look.light_color)
    strength, about_x, about_y = FILL[0] * look.light_ambient / USUAL_FILL, *FILL[1:]
    stage.light(
        f"{root}/fill", intensity=strength, angle=LIGHT_ANGLE, turns=(about_x, about_y, 0.0), color=look.light_color
    )


def cameras(stage: UsdStage, root: str, table: tuple[float, float, float, float]) -> None:
    """One above the table and one in front of it."""
    x0, y0, x1, y1 = table
    x, y, side = (x0 + x1) / 2.0, (y0 + y1) / 2.0, max(x1 - x0, y1 - y0)
    high = 2.0 * FOCUS * math.tan(math.radians(CAMERA_FIELD / 2.0))
    lens = (FOCUS, high * CAMERA_RATIO, high)
    stage.camera(f"{root}/top", at=(x, y, 1.6 * side), turn=0.0, lens=lens)
    stage.camera(f"{root}/front", at=(x, y - 1.1 * side, 1.1 * side), turn=45.0, lens=lens)


# Newer versions of USD allow more letters; those of Isaac Sim before 5 do not.
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_OTHER = re.compile(r"[^A-Za-z0-9_]+")


def identifiers(names: Iterable[str]) -> dict[str, str]:
    """An identifier for each of different names, no two alike: the name itself if it is one, as `mug`, else the name
    with underscores, as `block_1` for `block[1]`, and a number where that is taken."""
    wanted = list(names)
    kept = {name for name in wanted if _IDENTIFIER.fullmatch(name)}
    used, found = set(kept), {}
    for name in wanted:
        found[name] = name if name in kept else free(_plain(name), used)
        used.add(found[name])
    return found


def free(wish: str, used: Collection[str]) -> str:
    """`wish`, or with the least number from 2 that makes it different from all that are used."""
    name, number = wish, 1
    while name in used:
        number += 1
        name = f"{wish}_{number}"
    return name


def _plain(name: str) -> str:
    """An identifier with the letters and digits of a name."""
    word = _OTHER.sub("_", name).strip("_") or "object"
    return f"_{word}" if word[0].isdigit() else word


CONTACT = "contact"  # the name of the material for contacts


def part(root: str, number: int) -> tuple[str, str]:
    """The path of a mesh that is drawn, and the name of its material."""
    return f"{root}/visuals/part_{number}", f"part_{number}"


def picture(form: BodyForm, number: int) -> str:
    """The name of the file with the texture of a part, beside that of the form."""
    return f"{form.name}_{number}.png"


def body_file(body: Body) -> bytes:
    """The form of a body with its mass, friction and colours."""
    root = f"/{body.form.name}"
    stage = UsdStage(root, "component")
    moments, axes = principal(body.moments)
    stage.rigid(root, body.mass, body.form.inertia.center.tolist(), moments, axes)
    place = stage.materials(root)
    contact = f"{place}/{CONTACT}"
    stage.contact(contact, body.friction)
    stage.xform(f"{root}/visuals")
    for number, (mesh, color) in enumerate(zip(body.form.parts, body.colors, strict=True), start=1):
        path, name = part(root, number)
        stage.mesh(path, mesh, shade_mesh(mesh)[1])
        material(stage, root, name, color)
        cover(stage, root, path, name, color)
        paint = body.form.paints.get(number)
        if paint is not None:
            stage.places(path, paint.places[mesh.faces.ravel()])
            stage.image(f"{place}/{name}", f"./{picture(body.form, number)}", color)
    stage.guide(f"{root}/collisions")
    for number, piece in enumerate(body.form.pieces, start=1):
        path = f"{root}/collisions/piece_{number}"
        if piece.box is None:
            stage.mesh(path, piece.mesh)
        else:
            stage.box(path, *piece.box)
        stage.collider(path, contact, hull=piece.box is None)
    stage.finish()
    return stage.text()


ROOT, AROUND = "/Scene", "/Environment"
GRAVITY = 9.81  # m/s^2
STONE: RGB = (0.66, 0.67, 0.69)
FLOOR_SIDE, FLOOR_THICKNESS = 20.0, 0.1  # metres: the floor
ABOVE = 0.0001  # metres: a textured sheet, which collides with nothing, above what it covers
# On the table the object's coefficient counts: PhysX takes the larger one where a material says so, MuJoCo always.
SLIPPERY, LARGER = 0.01, "max"


class UsdScenes:
    """The scenes of a world, or those of one look. `folder` is the path of the meshes from their files, `ending` that
    of the meshes."""

    def __init__(self, world: World, folder: str, ending: str, dressed: SceneLook | None = None) -> None:
        self.world = world
        names = [body.name for body in world.bodies] if world.record is None else world.record.everything
        self.names = identifiers(names)  # the same in every scene of a file
        stage = UsdStage(ROOT, "assembly", world.title)
        self._table(stage, f"{ROOT}/{free('table', self.names.values())}", dressed)
        for body in world.tinted_bodies(dressed):
            self._body(stage, body, f"./{folder}/{body.form.name}{ending}")
        _environment(stage, world, dressed)
        stage.finish()
        self.layer = stage

    def scene_file(self, index: int) -> bytes:
        """The file of one scene."""
        for name, (at, turn) in self._places(index).items():
            self.layer.place(f"{ROOT}/{name}", at, turn)
        self.layer.say(ROOT, {**self._facts(), **self._facts_of(index)})
        return self.layer.text()

    def all_in_one(self, among: str) -> bytes:
        """One file, with the scenes as variants `scene_0001`, ... of the set `among`."""
        self.layer.say(ROOT, self._facts())
        self.layer.variants(ROOT, among)
        for index, scene in enumerate(self.world.scenes):
            self.layer.variant(ROOT, among, f"scene_{scene:04d}", self._facts_of(index), self._places(index))
        return self.layer.text()

    def _places(self, index: int) -> dict[str, tuple[tuple[float, float, float], Quaternion]]:
        return {
            self.names[body.name]: ((x, y, z), (qw, qx, qy, qz))
            for body, (x, y, z, qw, qx, qy, qz) in zip(self.world.bodies, self.world.places(index), strict=True)
        }

    def _facts(self) -> dict[str, Any]:
        """What all scenes share."""
        record = self.world.record
        if record is None:
            return {}
        varying = {"counts": record.counts, "assets": record.assets}
        return {"spec": record.spec} | {key: value for key, value in varying.items() if value}

    def _facts_of(self, index: int) -> dict[str, Any]:
        record = self.world.record
        phi = {} if record is None else {label: float(values[index]) for label, values in record.phi.items()}
        return {"scene": self.world.scenes[index], "phi": phi}

    def _body(self, stage: UsdStage, body: Body, file: str) -> None:
        path = f"{ROOT}/{self.names[body.name]}"
        stage.refer(path, file)
        stage.known_as(path, body.name)
        if body.fixed:
            stage.hold(path)
        for number, color in enumerate(body.colors, start=1):
            recolor(stage, path, *part(path, number), color)

    def _table(self, stage: UsdStage, path: str, dressed: SceneLook | None) -> None:
        """The table, the regions on it, which are only drawn, and those at heights, which carry."""
        stage.xform(path, "component")
        contact = f"{stage.materials(path)}/{CONTACT}"
        stage.contact(contact, SLIPPERY, LARGER)
        color = WOODEN if dressed is None else dressed.table.mean
        material(stage, path, "wood", color)
        for number, (center, sizes) in enumerate(self.world.slabs()):
            slab = f"{path}/leg_{number}" if number else f"{path}/top"
            stage.box(slab, center, sizes)
            stage.collider(slab, contact, hull=False)
            cover(stage, path, slab, "wood", color)
        if dressed is not None and dressed.table.file:
            x0, y0, x1, y1 = self.world.table
            top = Wall(((x0 + x1) / 2.0, (y0 + y1) / 2.0, ABOVE), (1.0, 0.0, 0.0), x1 - x0, y1 - y0, (0.0, 1.0, 0.0))
            covering(stage, path, "cover", dressed.table)
            cover_rectangle(stage, path, f"{path}/cover", "cover", top, dressed.table)
        for number, patch in enumerate(self.world.patches, start=1):
            name, mesh = f"region_{number}", patch.mesh()
            region = f"{path}/{name}"
            stage.mesh(region, mesh, shade_mesh(mesh)[1])
            material(stage, path, name, patch.color)
            cover(stage, path, region, name, patch.color)
            if patch.solid:
                stage.collider(region, contact, hull=True)


def _environment(stage: UsdStage, world: World, dressed: SceneLook | None) -> None:
    """Outside of the default prim: what a stage has once, however many scenes it refers to."""
    stage.xform(AROUND)
    stage.gravity(f"{AROUND}/physics", GRAVITY)
    lights(stage, AROUND, dressed)
    cameras(stage, AROUND, world.table)
    floor = f"{AROUND}/floor"
    x0, y0, x1, y1 = world.table
    x, y = (x0 + x1) / 2.0, (y0 + y1) / 2.0
    stage.box(floor, (x, y, -TALL - FLOOR_THICKNESS / 2.0), (FLOOR_SIDE, FLOOR_SIDE, FLOOR_THICKNESS))
    contact = f"{stage.materials(AROUND)}/{CONTACT}"
    stage.contact(contact, SLIPPERY, LARGER)
    stage.collider(floor, contact, hull=False)
    stone = STONE if dressed is None else dressed.ground.mean
    material(stage, AROUND, "stone", stone)
    cover(stage, AROUND, floor, "stone", stone)
    if dressed is None:
        return
    width, height = dressed.camera.size
    high = 2.0 * FOCUS * math.tan(math.radians(dressed.look.camera_fov) / 2.0)
    stage.camera_by(f"{AROUND}/look", dressed.camera.view, (FOCUS, high * width / height, high))
    if dressed.ground.file:
        ground = Wall((x, y, ABOVE - TALL), (1.0, 0.0, 0.0), FLOOR_SIDE, FLOOR_SIDE, (0.0, 1.0, 0.0))
        covering(stage, AROUND, "ground", dressed.ground)
        cover_rectangle(stage, AROUND, f"{AROUND}/ground", "ground", ground, dressed.ground)
    for number, wall in enumerate(dressed.each_wall(-TALL, world.table), start=1):
        if number == 1:
            covering(stage, AROUND, "wall", dressed.walls)
        cover_rectangle(stage, AROUND, f"{AROUND}/wall_{number}", "wall", wall, dressed.walls)


ENDING = ".usda"
KEY, KEY_EACH = 3_000, 1_500  # bytes of memory for a variant, and for each object in it
VARIANT_SET = "scene"


def meshes(world: World) -> Iterator[tuple[str, bytes]]:
    """Additional files of this world's scenes: name, bytes."""
    named = set[str]()
    for body in world.bodies:
        if body.form.name not in named:
            named.add(body.form.name)
            yield f"{body.form.name}{ENDING}", body_file(body)
            for number, paint in body.form.paints.items():
                yield picture(body.form, number), paint.png


def files(world: World, folder: str, *, together: bool) -> Iterator[bytes]:
    """The scenes as one file with a variant for each, or as a file each. `folder` is the path of the meshes from
    there. Raises RequestError for too many scenes in one file."""
    if together:
        check_room(len(world.poses), KEY + KEY_EACH * len(world.bodies))
    if world.dressing is not None:
        for index, number in enumerate(world.scenes):
            yield UsdScenes(world, folder, ENDING, world.dressing.scene_look(number, world.table)).scene_file(index)
        return
    scene = UsdScenes(world, folder, ENDING)
    if together:
        yield scene.all_in_one(VARIANT_SET)
        return
    for index in range(len(world.poses)):
        yield scene.scene_file(index)
