"""glTF files: what they show, and that what is damaged, huge or incomplete is refused with the reason."""

import json
import random
import zlib

import numpy as np
import pytest

from scenegen.errors import SpecError
from scenegen.geometry import Box
from scenegen.lang.checker import check_file
from scenegen.things.gltf import surfaces
from scenegen.things.mesh import Mesh
from scenegen.things.outline import MeshError
from scenegen.things.urdf import mesh_outline

from .gltf_files import BODY, CORNERS, FACES, UV, document, glb, inline, png


def nothing(name):
    raise AssertionError(f"{name} is not wanted")


def refused(made, words, read=nothing):
    with pytest.raises(MeshError) as caught:
        surfaces("a.glb", made if isinstance(made, bytes) else glb(made), read)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_box_stands_upright_with_its_colour():
    (surface,) = surfaces("box.GLB", glb(), nothing)
    assert surface.color == (1.0, 0.0, 0.0) and surface.texture == b"" and surface.uv is None
    mesh = Mesh(surface.vertices, surface.faces)
    assert mesh.is_closed and mesh.volume == pytest.approx(0.2 * 0.3 * 0.1)
    footprint, height = mesh_outline("box.glb", glb(), nothing)
    assert isinstance(footprint, Box) and height == pytest.approx(0.3, abs=1e-6)
    assert (footprint.length, footprint.width) == pytest.approx((0.2, 0.1), abs=1e-6)


def test_its_texture_comes_from_the_file_from_a_text_or_from_beside_it():
    image = png()
    inside = document(texture={"bufferView": 3, "mimeType": "image/png"})
    inside["bufferViews"].append({"buffer": 0, "byteOffset": len(BODY), "byteLength": len(image)})
    (first,) = surfaces("a.glb", glb(inside, BODY + image), nothing)
    (second,) = surfaces("a.glb", glb(document(texture={"uri": inline(image)})), nothing)
    asked = []

    def read(name):
        asked.append(name)
        return BODY if name == "a.bin" else image

    apart = document(texture={"uri": "skin%20one.png"}, buffers=[{"uri": "a.bin", "byteLength": len(BODY)}])
    (third,) = surfaces("a.gltf", json.dumps(apart).encode(), read)
    assert asked == ["a.bin", "skin one.png"]
    for surface in (first, second, third):
        assert surface.texture == image and np.array_equal(surface.uv, UV)


def test_nodes_place_meshes_and_mirrors_keep_the_outside_out():
    half = 0.5**0.5
    nodes = [
        {"children": [1], "scale": [2.0, 2.0, -2.0]},
        {"mesh": 0, "rotation": [0.0, half, 0.0, half], "translation": [1.0, 0.0, 0.0]},
    ]
    (surface,) = surfaces("a.glb", glb(document(nodes=nodes)), nothing)
    mesh = Mesh(surface.vertices, surface.faces)
    assert mesh.volume == pytest.approx(8 * 0.2 * 0.3 * 0.1)
    assert mesh.vertices.min(axis=0) == pytest.approx([1.9, -0.2, 0.0], abs=1e-6)
    matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]
    (moved,) = surfaces("a.glb", glb(document(nodes=[{"mesh": 0, "matrix": matrix}])), nothing)
    assert moved.vertices.min(axis=0) == pytest.approx([4.9, -7.05, 6.0], abs=1e-5)


def test_strips_fans_and_triangles_without_indices_are_triangles():
    square = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], dtype="<f4")
    for mode, points in ((5, square), (6, square[[0, 1, 3, 2]]), (4, square[[0, 1, 2, 2, 1, 3]])):
        made = document(meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "mode": mode}]}])
        made["accessors"][0]["count"] = len(points)
        (surface,) = surfaces("a.glb", glb(made, points.tobytes() + BODY), nothing)
        corners = surface.vertices[surface.faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert np.allclose(across, [(0.0, -1.0, 0.0)] * 2)


ACCESSOR = {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"}
REFUSED = {
    "no GLB": (b"solid thing", "no GLB file"),
    "cut": (glb()[:-9], "cut short"),
    "old": (b"glTF" + b"\1\0\0\0" + b"\0" * 20, "not glTF 2.0"),
    "deep JSON": (glb().replace(b'"asset"', b"[" * 7), "JSON is damaged"),
    "old version": (document(asset={"version": "1.0"}), "not glTF 2.0"),
    "announces gigabytes": (
        document(accessors=[{**ACCESSOR, "count": 4_000_000_000}, *document()["accessors"][1:]]),
        "more than 4,000,000 vertices",
    ),
    "announces zeros": (document(accessors=[{"componentType": 5126, "count": 900, "type": "VEC3"}]), "accessors[1]"),
    "no data": (
        document(accessors=[{"componentType": 5126, "count": 9, "type": "VEC3"}, *document()["accessors"][1:]]),
        "sparse or no data",
    ),
    "ends outside": (
        document(accessors=[{**ACCESSOR, "count": 9}, *document()["accessors"][1:]]),
        "ends outside its buffer",
    ),
    "a wide stride": (
        document(bufferViews=[{**document()["bufferViews"][0], "byteStride": 10**30}, *document()["bufferViews"][1:]]),
        "ends outside its buffer",
    ),
    "the same mesh a million times": (
        document(
            nodes=[{"children": list(range(1, 601))}, *[{"mesh": 0}] * 600],
            meshes=[{"primitives": document()["meshes"][0]["primitives"] * 1000}],
        ),
        "more than 10,000 parts",
    ),
    "many nodes": (document(nodes=[{}] * 20_001), "more than 20,000 nodes"),
    "a circle": (document(nodes=[{"children": [0]}]), "two parents, or is its own"),
    "no such node": (document(scenes=[{"nodes": [7]}]), "nodes[7]"),
    "a negative node": (document(scenes=[{"nodes": [-1]}]), "no list of whole numbers"),
    "empty": (document(nodes=[{}]), "has triangles"),
    "skin": (document(nodes=[{"mesh": 0, "skin": 0}]), "skeleton"),
    "compressed": (document(extensionsRequired=["KHR_draco_mesh_compression"]), "KHR_draco_mesh_compression"),
    "no rotation": (document(nodes=[{"mesh": 0, "rotation": [0, 0, 0, 0]}]), "all zeros"),
    "words": (document(nodes=[{"mesh": 0, "scale": ["1", 1, 1]}]), "not 3 numbers"),
    "far": (document(nodes=[{"mesh": 0, "scale": [1e300, 1, 1]}]), "not 3 numbers"),
    "far in steps": (
        document(nodes=[{"children": [k + 1], "scale": [1e8] * 3} for k in range(60)] + [{"mesh": 0}]),
        "beyond all measure",
    ),
    "an address": (document(texture={"uri": "http://somewhere/x.png"}), "only files beside it"),
    "a path": (document(texture={"uri": "/etc/passwd"}), "only files beside it"),
    "no base64": (document(texture={"uri": "data:image/png;base64,*"}), "not in base64"),
    "no picture": (document(texture={"uri": inline(b"GIF89a")}), "neither PNG nor JPEG"),
    "no uv": (
        document(
            texture={"uri": inline(png())},
            meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        ),
        "TEXCOORD_0",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_of_no_use_is_refused_with_the_reason(name):
    refused(*REFUSED[name])


def test_a_picture_that_announces_too_many_pixels_is_not_read():
    for width, height in ((8192, 8193), (60_000, 60_000)):
        image = bytearray(png())
        image[16:24] = width.to_bytes(4, "big") + height.to_bytes(4, "big")
        image[29:33] = zlib.crc32(bytes(image[12:29])).to_bytes(4, "big")
        refused(document(texture={"uri": inline(bytes(image))}), "pixels together")


def test_a_triangle_of_no_vertex_is_refused():
    body = bytearray(BODY)
    body[96:98] = b"\x08\x00"
    refused(glb(body=bytes(body)), "names vertex 8 of 8")


def test_damaged_files_are_read_or_refused():
    source = random.Random(5)
    whole = glb(document(texture={"uri": inline(png())}))
    read = 0
    for _ in range(400):
        data = bytearray(whole)
        for _ in range(source.randint(1, 4)):
            at = source.randrange(12, len(data) - 200)
            new = source.choice([b"-", b"9", b'"', b"{}", b"[", b"null", b"\xff", b"0", b"7"])
            data[at : at + len(new)] = new  # as long as before: the file says its length
        try:
            mesh_outline("a.glb", bytes(data), lambda name: b"")
            read += 1
        except MeshError as error:
            assert str(error) and "\n" not in str(error)
    assert 10 < read < 380, read  # materials are read, too: what is damaged there is refused


def test_specs_take_them_and_say_where_something_is_missing(tmp_path):
    text = b'object mug = mesh("box.gltf"), plate\ntask: leftOf(mug, plate)'
    made = document(texture={"uri": "skin.png"}, buffers=[{"uri": inline(BODY), "byteLength": len(BODY)}])
    (tmp_path / "box.gltf").write_text(json.dumps(made))
    with pytest.raises(SpecError, match=r"skin\.png") as caught:
        check_file(tmp_path / "s.spec", text)
    assert caught.value.diagnostics[0].span.text == '"box.gltf"'
    (tmp_path / "skin.png").write_bytes(png())
    spec = check_file(tmp_path / "s.spec", text)
    assert spec.shapes[0].height == pytest.approx(0.3, abs=1e-6)
    made["images"] = [{"uri": "../skin.png"}]
    (tmp_path / "box.gltf").write_text(json.dumps(made))
    with pytest.raises(SpecError) as caught:
        check_file(tmp_path / "s.spec", text)
    assert caught.value.diagnostics[0].code == "outside-folder"


def test_faces_and_corners_of_the_tests_are_a_closed_box():
    assert Mesh(CORNERS.astype(float), FACES.astype(int)).volume == pytest.approx(0.006)


def painted(pbr=None, extensions=None, *, sampler=None, used=None, required=(), uv=None):
    """A box with a material of these parts, and what becomes of it."""
    made = document(texture={"bufferView": 3, "mimeType": "image/png"})
    body = BODY[:-64] + (UV if uv is None else np.asarray(uv, dtype="<f4")).tobytes() + png()
    made["bufferViews"] += [{"buffer": 0, "byteOffset": len(BODY), "byteLength": len(png())}]
    made["buffers"] = [{"byteLength": len(body)}]
    made["materials"] = [{}]
    if pbr is not None:
        made["materials"][0]["pbrMetallicRoughness"] = pbr
    if extensions is not None:
        made["materials"][0]["extensions"] = extensions
    if sampler is not None:
        made["textures"], made["samplers"] = [{"source": 0, "sampler": 0}], [sampler]
    if required:
        made["extensionsRequired"] = list(required)
    (found,) = surfaces("a.glb", glb(made, body), nothing)
    return found


GLOSS, MOVED = "KHR_materials_pbrSpecularGlossiness", "KHR_texture_transform"


def test_materials_of_specular_glossiness_are_read():
    assert painted(extensions={GLOSS: {"diffuseFactor": [1, 0, 0, 1]}}, required=[GLOSS]).color == (1.0, 0.0, 0.0)
    found = painted(extensions={GLOSS: {"diffuseTexture": {"index": 0}}}, required=[GLOSS])
    assert found.texture == png() and found.color == (1.0, 1.0, 1.0)
    both = painted({"baseColorFactor": [0, 1, 0, 1]}, {GLOSS: {"diffuseFactor": [0, 0, 1, 1]}})
    assert both.color == (0.0, 0.0, 1.0)  # who knows the extension takes it
    assert painted().color == (1.0, 1.0, 1.0) and not painted().texture


@pytest.mark.parametrize(
    ("moved", "wanted"),
    [
        ({"offset": [0.5, 0.0], "scale": [0.5, 0.5]}, [(0.5, 0.0), (1.0, 0.0), (0.5, 0.5)]),
        ({"rotation": np.pi / 2}, [(0.0, 0.0), (0.0, -1.0), (1.0, 0.0)]),
        # the example of the extension: the lower left quadrant of the picture
        ({"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5]}, [(0.0, 1.0), (0.0, 0.5), (0.5, 1.0)]),
        ({"offset": [0, 1], "scale": [1, -1]}, [(0.0, 1.0), (1.0, 1.0), (0.0, 0.0)]),
    ],
)
def test_transforms_of_textures_are_applied(moved, wanted):
    places = np.tile([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.0, 0.0)], (2, 1))
    image = {"index": 0, "extensions": {MOVED: moved}}
    found = painted({"baseColorTexture": image}, uv=places, required=[MOVED])
    np.testing.assert_allclose(found.uv[:3], wanted, atol=1e-12)


def test_a_transform_may_name_other_places():
    image = {"index": 0, "texCoord": 1, "extensions": {MOVED: {"texCoord": 0}}}
    np.testing.assert_allclose(painted({"baseColorTexture": image}).uv, UV)
    with pytest.raises(MeshError, match=r"rotation of .* is not a number"):
        painted({"baseColorTexture": {"index": 0, "extensions": {MOVED: {"rotation": "x"}}}})


@pytest.mark.parametrize("mode", [33071, 33648])
def test_textures_that_do_not_repeat_stay_within_their_edges(mode):
    image = {"baseColorTexture": {"index": 0}}
    assert painted(image, sampler={"wrapS": mode, "wrapT": mode}).texture
    wide = UV * (3.0, 1.0)
    assert painted(image, sampler={"wrapT": mode}, uv=wide).uv.max() > 1.0
    with pytest.raises(MeshError, match=r"does not repeat .wrapS of its sampler"):
        painted(image, sampler={"wrapS": mode}, uv=wide)


@pytest.mark.parametrize("extension", ["KHR_materials_unknown", "KHR_texture_basisu", "EXT_mesh_gpu_instancing", "X"])
def test_what_a_file_requires_is_read_or_refused(extension):
    with pytest.raises(MeshError, match=f"it needs the extension {extension}"):
        painted(required=[extension])
    painted(required=["KHR_materials_unlit", "KHR_mesh_quantization"])


def test_vertices_of_no_triangle_count_for_nothing():
    made = document()
    for accessor, count in ((0, 9), (2, 9)):
        made["accessors"][accessor]["count"] = count
    corners = np.vstack([CORNERS, [(9, 9, 9)]]).astype("<f4").tobytes()
    faces, uv = FACES.tobytes(), np.vstack([UV, [(0, 0)]]).astype("<f4").tobytes()
    sizes = len(corners), len(faces), len(uv)
    starts = np.cumsum([0, *sizes])
    made["bufferViews"] = [
        {"buffer": 0, "byteOffset": int(start), "byteLength": size} for start, size in zip(starts, sizes, strict=False)
    ]
    made["buffers"] = [{"byteLength": int(starts[-1])}]
    (found,) = surfaces("a.glb", glb(made, corners + faces + uv), nothing)
    assert found.vertices.shape == (8, 3) and np.abs(found.vertices).max() < 1.0
