"""glTF files that tests make: a box of 20 by 10 by 30 cm (the last upwards), red, with a texture where one is given."""

import base64
import io
import json
import struct

import numpy as np
from PIL import Image

CORNERS = np.array([(x, y, z) for x in (-0.1, 0.1) for y in (0.0, 0.3) for z in (-0.05, 0.05)], dtype="<f4")
FACES = np.array(
    [
        (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ],
    dtype="<u2",
)  # fmt: skip
UV = np.tile(np.array([(0.25, 0.5), (0.75, 0.5)], dtype="<f4"), (4, 1))
BODY = CORNERS.tobytes() + FACES.tobytes() + UV.tobytes()


def png(width=8, height=4):
    """Its left half is green, its right half blue."""
    pixels = np.zeros((height, width, 3), dtype=np.uint8)
    pixels[:, : width // 2, 1] = pixels[:, width // 2 :, 2] = 255
    made = io.BytesIO()
    Image.fromarray(pixels).save(made, "PNG")
    return made.getvalue()


def document(*, texture=None, **changes):
    """The JSON of a .glb; `texture` is its image, as glTF says it; `changes` replace lists at the top."""
    material = {"baseColorFactor": [1.0, 0.0, 0.0, 1.0]} if texture is None else {"baseColorTexture": {"index": 0}}
    made = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0}]},
        ],
        "materials": [{"pbrMetallicRoughness": material}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5126, "count": 8, "type": "VEC2"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 72},
            {"buffer": 0, "byteOffset": 168, "byteLength": 64},
        ],
        "buffers": [{"byteLength": len(BODY)}],
    }
    if texture is not None:
        made |= {"textures": [{"source": 0}], "images": [texture]}
    return made | changes


def glb(made=None, body=BODY):
    text = json.dumps(document() if made is None else made).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(body), 0x004E4942) + body
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def inline(data, kind="application/octet-stream"):
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"
