"""URDF files and meshes that the tests of outlines share."""

import struct
from pathlib import Path

import numpy as np

from scenegen.things.urdf import outline

HERE = Path(__file__).parent / "urdf"
OBJ = (HERE / "bookend.obj").read_bytes()


def no_mesh(name):
    raise AssertionError(f"{name} is not wanted")


def robot(*shapes, links="", **meshes):
    """The outline of one link with shapes given as (geometry, attributes of origin)."""
    body = "".join(f"<collision><origin {at}/><geometry>{solid}</geometry></collision>" for solid, at in shapes)
    text = f'<robot name="r"><link name="base">{body}</link>{links}</robot>'
    return outline(text.encode(), lambda name: meshes[name.partition(".")[0]])


def box(x, y, z):
    return f'<box size="{x} {y} {z}"/>'


def cylinder(radius, length):
    return f'<cylinder radius="{radius}" length="{length}"/>'


def close(footprint, corners, within=1e-6):
    found = np.array(footprint.vertices)
    assert len(found) == len(corners)
    start = np.argmin(np.hypot(*(found - corners[0]).T))
    assert np.abs(np.roll(found, -start, axis=0) - corners).max() < within


def triangles():
    """The bookend's faces as corners, (F, 3, 3)."""
    rows = [line.split() for line in OBJ.decode().splitlines()]
    points = np.array([[float(word) for word in row[1:]] for row in rows if row and row[0] == "v"])
    faces = [[int(word) for word in row[1:4]] for row in rows if row and row[0] == "f"]
    faces += [[int(row[1]), int(row[3]), int(row[4])] for row in rows if row and row[0] == "f" and len(row) == 5]
    return points[np.array(faces) - 1]


def stl(start):
    faces = triangles().astype("<f4")
    body = b"".join(struct.pack("<3f", 0, 0, 1) + face.tobytes() + b"\0\0" for face in faces)
    return start.ljust(80, b" ") + struct.pack("<I", len(faces)) + body


def stl_text(scale=1.0):
    loops = "".join(
        "facet normal 0 0 1\n outer loop\n"
        + "".join(f"  vertex {x:e} {y:e} {z:e}\n" for x, y, z in scale * np.asarray(face))
        + " endloop\nendfacet\n"
        for face in triangles()
    )
    return f"solid bookend\n{loops}endsolid bookend\n".encode()
