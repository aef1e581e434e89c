"""Convex pieces, masses and frictions of files of one's own."""

import pickle
from functools import partial

import numpy as np
import pytest

from scenegen import needs
from scenegen.errors import RequestError
from scenegen.processes.process import WorkerProcess
from scenegen.things.mesh import Mesh, box, join
from scenegen.things.outline import MeshError
from scenegen.worlds import own_body
from scenegen.worlds import own_body as convex
from scenegen.worlds.own_body import convex_pieces, mesh_body, robot_body

from .gltf_files import glb

APART = join([box(1.0, 1.0, 1.0), box(1.0, 1.0, 1.0).shift(x=3.0)])


@pytest.fixture(autouse=True)
def pieces_are_kept_elsewhere(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    convex._pieces.cache_clear()
    yield
    convex._pieces.cache_clear()


def played(program, order):
    """Does a program in CoACD's place, in the process that cuts; its `made` are the pieces."""
    names = {"order": order}
    exec(program, names)  # noqa: S102
    return names.get("made")


def cutter(monkeypatch, program):
    """A program takes CoACD's place; it is told how often it ran."""
    monkeypatch.setattr(convex, "need", lambda *_: None)
    monkeypatch.setattr(convex, "cut", partial(played, program))
    runs = []

    def process(what, *rest):
        runs.append(what)
        return WorkerProcess(what, *rest)

    monkeypatch.setattr(convex, "WorkerProcess", process)
    return runs


@pytest.mark.parametrize("turned", [False, True])
def test_a_convex_mesh_is_its_own_piece(turned):
    whole = box(0.1, 0.2, 0.3)
    split = Mesh(
        whole.vertices[whole.faces].reshape(-1, 3), np.arange(whole.faces.size).reshape(-1, 3)
    )  # as .stl files have it
    (piece,) = convex_pieces(Mesh(split.vertices, split.faces[:, ::-1]) if turned else split)
    assert piece.is_closed and piece.volume == pytest.approx(0.006)


def test_a_gltf_box_is_a_body_without_mass():
    body = mesh_body("a.glb", glb(), None)
    assert len(body.pieces) == 1 and body.mass is None and body.friction is None
    assert body.shift(np.array([0.0, 0.0, -0.1])).pieces[0].vertices[:, 2].min() == pytest.approx(
        body.pieces[0].vertices[:, 2].min() - 0.1
    )


def test_pieces_stay_in_the_box_face_outwards_and_are_kept(monkeypatch):
    half = box(1.1, 1.0, 1.0)
    sheet = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
    made = [
        (half.vertices, half.faces[:, ::-1]),
        (sheet, np.array([(0, 1, 2)])),
        (half.shift(x=3.0).vertices, half.faces),
    ]
    answer = pickle.dumps([(np.asarray(v, float), np.asarray(f, np.int64)) for v, f in made])
    runs = cutter(monkeypatch, f"import pickle; made = pickle.loads({answer!r})")
    first = convex_pieces(APART)
    assert len(first) == 2 and all(piece.volume > 0.99 for piece in first)
    assert first[0].vertices[:, 0].min() == -0.5 and first[1].vertices[:, 0].max() == 3.5
    convex._pieces.cache_clear()  # as in another process
    again = convex_pieces(APART)
    assert len(runs) == 1 and all(np.array_equal(a.vertices, b.vertices) for a, b in zip(first, again, strict=True))
    (kept,) = convex._folder().iterdir()
    for damaged in (b"", b"PK\x03\x04", kept.read_bytes()[:-40]):
        kept.write_bytes(damaged)
        convex._pieces.cache_clear()
        assert len(convex_pieces(APART)) == 2
    assert len(runs) == 4


def test_what_cannot_be_cut_says_why(monkeypatch):
    with pytest.raises(MeshError, match="it has no volume"):
        convex_pieces(Mesh(np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0)]), np.array([(0, 1, 2)])))
    cutter(monkeypatch, "import os; os.write(2, b'no \\x1b[31mmanifold'); os._exit(3)")
    with pytest.raises(MeshError, match=r"CoACD cannot cut it into convex pieces: no \[31mmanifold"):
        convex_pieces(APART)
    cutter(monkeypatch, "raise ValueError('no \\x1b[31mmanifold')")
    with pytest.raises(MeshError, match=r"CoACD cannot cut it into convex pieces: no \[31mmanifold"):
        convex_pieces(APART)
    cutter(monkeypatch, "import os; os.abort()")
    with pytest.raises(MeshError, match="CoACD cannot cut it"):
        convex_pieces(APART)
    cutter(monkeypatch, "import time; time.sleep(20)")
    monkeypatch.setattr(convex, "MAX_CUT_SECONDS", 0.3)
    with pytest.raises(MeshError, match="takes more than 0 s"):
        convex_pieces(APART)
    monkeypatch.setattr(convex, "MAX_CUT_TRIANGLES", 23)
    with pytest.raises(MeshError, match="more than 23 triangles"):
        convex_pieces(APART)


def test_without_coacd_it_is_said_how_to_get_it(monkeypatch):
    monkeypatch.setattr(needs, "is_installed", lambda package: package != "coacd")
    with pytest.raises(RequestError) as caught:
        convex_pieces(APART)
    assert caught.value.diagnostics[0].code == "not-installed"
    assert "scenegen-dsl[meshes]" in caught.value.diagnostics[0].help


def robot(inside, rest=""):
    text = f'<robot name="r"><link name="base">{inside}</link>{rest}</robot>'
    return robot_body(text.encode(), None)


BOX = '<collision><origin xyz="0 0 1"/><geometry><box size="1 2 3"/></geometry></collision>'
BALL = '<visual><geometry><sphere radius="1"/></geometry></visual>'
ROD = '<collision><geometry><cylinder radius="1" length="2"/></geometry></collision>'
MASS = "<inertial><mass value='{}'/></inertial>"
TOP = f'<link name="top">{BALL}{MASS.format(0.5)}</link>'
JOINT = '<joint name="j" type="fixed"><parent link="base"/><child link="top"/><origin xyz="5 0 0"/></joint>'


def test_a_robot_has_its_own_shapes_mass_and_friction():
    grip = '<contact><lateral_friction value="0.7"/></contact>'
    body = robot(BOX + ROD + BALL + grip + MASS.format(0.25), TOP + JOINT)
    first, second, third = body.pieces  # the visual ball counts where no collision shape is
    assert np.allclose([first.vertices.min(0), first.vertices.max(0)], [(-0.5, -1, -0.5), (0.5, 1, 2.5)])
    assert np.allclose(second.vertices[:, 2].max(), 1.0) and np.allclose(third.vertices[:, 0].max(), 6.0)
    assert all(piece.is_closed and piece.volume > 0 for piece in body.pieces)
    assert (body.mass, body.friction) == (0.75, 0.7)


def test_pieces_are_counted_together(monkeypatch):
    monkeypatch.setattr(own_body, "MAX_OWN_PIECES", 20)
    with pytest.raises(MeshError, match="line 1, <cylinder>: it has more than 20 convex pieces"):
        robot(ROD * 21)


def test_frictions_of_gazebo_and_none():
    gazebo = '<gazebo reference="base"><mu1> 0.4\n</mu1></gazebo><gazebo reference="base"><mu1 value="0.9"/></gazebo>'
    assert robot(BOX, gazebo).friction == 0.9
    bare = robot(BOX + MASS.format(0))
    assert (bare.mass, bare.friction) == (None, None)


@pytest.mark.parametrize(
    ("inside", "rest", "words"),
    [
        (BOX + MASS.format(-1), "", r"line 1, <mass>: value=\"-1\" is negative"),
        (BOX + MASS.format("nan"), "", "is beyond all measure"),
        (BOX + MASS.format("1e-9"), "", "its mass of 1e-09 kg is beyond"),
        (BOX + "<inertial/>", "", "line 1, <inertial>: there is no <mass> in it"),
        (BOX + '<contact><lateral_friction value="500"/></contact>', "", "its friction of 500 is beyond 100"),
        (BOX, "<gazebo><mu1>rough</mu1></gazebo>", 'line 1, <mu1>: value="rough" is not a number'),
        (BOX, "<gazebo><mu1></mu1></gazebo>", "line 1, <mu1>: it has no value"),
        (BOX, "<gazebo><mu1>" + "9" * 100_000 + "</mu1></gazebo>", "is beyond all measure"),
    ],
)
def test_hostile_robots_are_refused(inside, rest, words):
    with pytest.raises(MeshError, match=words):
        robot(inside, rest)
