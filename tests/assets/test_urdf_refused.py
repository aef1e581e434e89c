"""URDF files that are of no use are refused with the reason, and damaged ones are read or refused."""

import random

import pytest

from scenegen.errors import SpecError
from scenegen.geometry import Polygon
from scenegen.geometry.footprint import is_convex
from scenegen.lang.checker import check_file
from scenegen.things.outline import MeshError
from scenegen.things.urdf import outline

from .urdf_files import HERE, OBJ, stl, stl_text

LINK = '<link name="a"><collision><geometry><box size="1 1 1"/></geometry></collision></link>'


def solid(text):
    return f'<robot>\n<link name="a"><collision>{text}</collision></link></robot>'


def mesh(name="m.obj", scale="1 1 1"):
    return solid(f'<geometry><mesh filename="{name}" scale="{scale}"/></geometry>')


def joint(parent, child, name="j"):
    return f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'


BAD = {
    "empty": ("", "not well-formed XML at line 1: no element found"),
    "cut short": ("<robot>\n<link", "not well-formed XML at line 2"),
    "no XML": ("solid thing", "not well-formed XML at line 1"),
    "encoding": ('<?xml version="1.0" encoding="klingon"?><robot/>', "not well-formed"),
    "entities": ('<!DOCTYPE r [<!ENTITY a "aaaa">]><robot>&a;</robot>', "document type"),
    "xacro": ('<robot><xacro:include filename="a"/></robot>', "xacro file"),
    "another format": ("<sdf/>", "outermost element is <sdf>"),
    "deep": ("<robot>" + "<a>" * 60 + "</a>" * 60 + "</robot>", "nested more than"),
    "long": ("<robot>" + "<a/>" * 20_001 + "</robot>", "more than 20,000 elements"),
    "no link": ("<robot/>", "has no link"),
    "no shape": ('<robot><link name="a"/></robot>', "no link of it has a shape"),
    "no geometry": (solid(""), "line 2, <collision>: there is no <geometry>"),
    "empty geometry": (solid("<geometry/>"), "here is nothing"),
    "capsule": (solid("<geometry><capsule/></geometry>"), "box, cylinder, sphere or mesh; here is <capsule>"),
    "two": (solid("<geometry><box/><box/></geometry>"), "here is <box> and <box>"),
    "no size": (solid("<geometry><box/></geometry>"), "<box>: it has no size"),
    "a word": (solid('<geometry><box size="1 1 wide"/></geometry>'), 'size="1 1 wide" is not 3 numbers'),
    "two numbers": (solid('<geometry><box size="1 1"/></geometry>'), "is not 3 numbers"),
    "underscore": (solid('<geometry><box size="1 1 1_0"/></geometry>'), "is not 3 numbers"),
    "nan": (solid('<geometry><sphere radius="nan"/></geometry>'), "beyond all measure"),
    "infinite": (solid('<origin xyz="0 inf 0"/><geometry><sphere radius="1"/></geometry>'), "beyond all measure"),
    "negative": (solid('<geometry><sphere radius="-1"/></geometry>'), "is negative"),
    "flat": (solid('<geometry><box size="1 1 0"/></geometry>'), "no height"),
    "a line": (solid('<geometry><box size="1 0 1"/></geometry>'), "no area"),
    "a needle": (solid('<geometry><cylinder radius="0" length="1"/></geometry>'), "no area"),
    "a point": (solid('<geometry><sphere radius="0"/></geometry>'), "no area"),
    "millimetres": (
        solid('<geometry><box size="2000 80 90"/></geometry>'),
        'would measure 2,000 m; if its numbers are millimetres, write scale="0.001 0.001 0.001"',
    ),
    "two links of a name": (f"<robot>{LINK}{LINK}</robot>", "a second link `a`"),
    "two roots": (f'<robot>{LINK}<link name="b"/></robot>', "no joint moves `a` and none `b`"),
    "no such link": (f"<robot>{LINK}{joint('a', 'b')}</robot>", "there is no link `b`"),
    "a circle": (f'<robot>{LINK}<link name="b"/>{joint("a", "b")}{joint("b", "a")}</robot>', "in a circle through"),
    "its own parent": (f"<robot>{LINK}{joint('a', 'a')}</robot>", "in a circle through link `a`"),
    "two parents": (f'<robot>{LINK}<link name="b"/>{joint("a", "b")}{joint("a", "b", "k")}</robot>', "two parents"),
    "a circle aside": (
        f'<robot>{LINK}<link name="b"/><link name="c"/>{joint("b", "c")}{joint("c", "b")}</robot>',
        "in a circle through link `b`",
    ),
    "a joint without a child": (f'<robot>{LINK}<joint><parent link="a"/></joint></robot>', "there is no <child>"),
    "collada": (mesh("m.dae"), "mesh m.dae: only .obj and .stl meshes are read in a URDF file"),
    "no ending": (mesh("m"), "mesh m: only .obj and .stl meshes"),
    "no such file": (mesh(""), "it has no filename"),
    "obj without vertices": (mesh("empty.obj"), "it has no vertices"),
    "obj with a word": (mesh("word.obj"), "not three numbers"),
    "obj with an underscore": (mesh("underscore.obj"), "not three numbers"),
    "obj with nan": (mesh("nan.obj"), "no number"),
    "stl cut": (mesh("cut.stl"), "cut short"),
    "stl tiny": (mesh("word.stl"), "no STL file"),
    "no scale": (mesh(scale="0 0 0"), "no area"),
}
MESHES = {
    "m": OBJ,
    "empty": b"# nothing\n",
    "word": b"v 1 2 x\n",
    "nan": b"v 1 2 nan\n",
    "underscore": b"v 1_0 0 0\nv 0 0 0\nv 0 1 1\n",
    "cut": b"\0" * 80 + b"\xff\0\0\0" + b"0" * 99,
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_of_no_use_is_refused_with_the_reason(name):
    text, words = BAD[name]
    with pytest.raises(MeshError) as caught:
        outline(text.encode(), lambda name: MESHES[name.partition(".")[0]])
    assert words in str(caught.value)


def test_damaged_files_are_read_or_refused():
    """Bytes changed at random, in the URDF and in its meshes: nothing but MeshError comes."""
    source = random.Random(7)
    tray, bookend = ((HERE / name).read_bytes() for name in ("tray.urdf", "bookend.urdf"))
    bookend_stl = bookend.replace(b".obj", b".stl")
    words = [
        b"-1",
        b"1e999",
        b"nan",
        b"<",
        b">",
        b'"',
        b"0",
        b"\xff",
        b"<link/>",
        b"<collision/>",
        b"1e-300",
        b"900000",
    ]

    def damaged(data):
        data = bytearray(data)
        for _ in range(source.randint(1, 4)):
            at = source.randrange(len(data))
            match source.randrange(3):
                case 0:
                    data[at] = source.randrange(256)
                case 1:
                    del data[at : at + source.randint(1, 60)]
                case 2:
                    data[at : at + source.randint(0, 4)] = source.choice(words)
        return bytes(data)

    meshes = [OBJ, stl_text(), stl(b"")]
    read = refused = 0
    for k in range(1500):
        urdf = (tray, bookend, bookend_stl)[k % 3]
        try:
            footprint, height = outline(damaged(urdf) if k % 2 else urdf, lambda name: damaged(source.choice(meshes)))
        except MeshError as error:
            assert str(error) and "\n" not in str(error)
            refused += 1
        else:
            assert 0.0 < height <= 1000.0 and min(footprint.extent) > 0.0
            if isinstance(footprint, Polygon):
                assert is_convex(footprint.vertices)
            read += 1
    assert read > 200 and refused > 200


def test_a_spec_whose_urdf_is_of_no_use_says_where(tmp_path):
    (tmp_path / "a.urdf").write_text(mesh("gone.obj"))
    (tmp_path / "b.urdf").write_text("<robot>")
    for name, words in (
        ("a", "cannot read gone.obj"),
        ("b", "b.urdf cannot be used: it is not well-formed XML at line 1"),
    ):
        text = f'object thing = urdf("{name}.urdf")\ntask: x(thing) >= 0.5'
        with pytest.raises(SpecError, match=words) as caught:
            check_file(tmp_path / "s.spec", text.encode())
        assert caught.value.diagnostics[0].span.text == f'"{name}.urdf"'
