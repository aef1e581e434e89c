"""Rendered photographs: the camera, the places of tags, and what is wrong with a picture."""

import numpy as np
import pytest

from scenegen.errors import DataError

cv2 = pytest.importorskip("cv2")

from experiments.stage.photographs import (  # noqa: E402 - after the skip
    draw_shot,
    grow_mat,
    mat_raster,
    render_photograph,
)
from scenegen.play.stage.camera import Lens, Photograph, find_camera  # noqa: E402
from scenegen.play.stage.measure import measure_poses, poses_by_tags  # noqa: E402
from scenegen.play.stage.overlay import draw_overlay  # noqa: E402

pytestmark = pytest.mark.long  # a picture takes half a second


@pytest.fixture(scope="module")
def scene(suite):
    start = next(one for one in suite if one.task.name == "apart")
    return start, start.task.scenes.poses[start.row] + (0.004, -0.003, 0.05)


@pytest.fixture(scope="module")
def draw(stage, scene):
    """A picture of the scene from a metre, and the camera."""

    def picture(mat=stage, **given):
        rng = np.random.default_rng(4)
        shot = draw_shot(rng, stage, 1.0)
        return render_photograph(stage, *scene, shot, rng, raster=mat_raster(mat), **given), shot

    return picture


@pytest.fixture(scope="module")
def plain(draw):
    return draw()


def refusal(stage, start, picture):
    with pytest.raises(DataError) as caught:
        photo = Photograph.from_picture(picture, "p.jpg")
        poses_by_tags(stage, start, photo, find_camera(stage, photo))
    (wrong,) = caught.value.diagnostics
    return wrong.text("title")


def test_objects_within_three_millimetres_and_a_degree(stage, scene, plain):
    start, poses = scene
    photo = Photograph.from_picture(plain[0], "p.jpg")
    for lens in (None, Lens(plain[1].matrix, plain[1].distortion)):
        camera = find_camera(stage, photo, lens)
        off = poses_by_tags(stage, start, photo, camera) - poses
        assert np.hypot(*off[:, :2].T).max() < 0.003 and abs(np.degrees(off[:, 2])).max() < 1.0
    flat = np.array([[0.1, 0.05], [-0.1, 0.0]])
    seen = camera.project(np.column_stack([flat, [0.04, 0.04]]))
    assert np.allclose(camera.place(seen, 0.04), flat, atol=1e-6)
    eye = -cv2.Rodrigues(plain[1].turn)[0].T @ plain[1].shift
    assert np.allclose(-camera.turn.T @ camera.shift, eye, atol=0.005)


def test_clicked_corners(stage, scene, plain, tmp_path):
    start, poses = scene
    photo, path = tmp_path / "p.png", tmp_path / "clicks.csv"
    cv2.imwrite(str(photo), plain[0])
    lines, spec = ["object,u,v"], start.task.spec.checked
    from scenegen.play.stage.stage import outline_at

    for which, name in enumerate(start.objects):
        shape = spec.shapes[which]
        outline = outline_at(shape, poses[which])[:: 20 if name == "green" else 1][:4]
        top = np.column_stack([outline, np.full(len(outline), shape.height)])
        seen = cv2.projectPoints(top, plain[1].turn, plain[1].shift, plain[1].matrix, plain[1].distortion)[0]
        lines += [f"{name},{u},{v}" for u, v in np.random.default_rng(0).permutation(seen.reshape(-1, 2))]
    path.write_text("\n".join(lines))
    off = measure_poses(stage, start, photo=photo, corners=path) - poses
    assert np.hypot(*off[:, :2].T).max() < 0.003 and abs(np.degrees(off[1:, 2])).max() < 1.0
    path.write_text("\n".join(line for line in lines if not line.startswith("red")))
    with pytest.raises(DataError) as caught:
        measure_poses(stage, start, photo=photo, corners=path)
    assert "does not show `red`" in caught.value.diagnostics[0].text("title")


def test_the_wrong_object_and_a_missing_tag(stage, scene, draw):
    start, _ = scene
    tags = [stage.thing(start.task.spec.checked, k).tag for k in range(3)]
    assert "shows `can[1]`, which this start does not have, and not `green`" in refusal(
        stage, start, draw(tags=[10, *tags[1:]])[0]
    )
    assert "does not show `red`" in refusal(stage, start, draw(tags=[tags[0], None, tags[2]])[0])


def test_tags_of_the_mat_that_are_covered(stage, scene, draw):
    start, poses = scene
    assert "2 of the 4 tags of the mat; missing: 1, 3" in refusal(stage, start, draw(covered=(1, 3))[0])
    photo = Photograph.from_picture(draw(covered=(1,))[0], "p.jpg")
    off = poses_by_tags(stage, start, photo, find_camera(stage, photo)) - poses
    assert np.hypot(*off[:, :2].T).max() < 0.003, "three are enough"


def test_a_mat_that_is_bent_printed_smaller_or_another(stage, scene, draw):
    start, _ = scene
    assert "is not flat" in refusal(stage, start, draw(bend=0.03)[0])
    assert "was printed at 9" in refusal(stage, start, draw(scale=0.97)[0])
    assert "is that of another suite" in refusal(stage, start, draw(mat=grow_mat(stage, 0.05))[0])


def test_a_picture_without_tags_and_no_picture(stage, scene, tmp_path):
    start, _ = scene
    assert "shows no tag of the mat" in refusal(stage, start, np.full((400, 600), 120, np.uint8))
    (tmp_path / "p.jpg").write_text("hello")
    with pytest.raises(DataError) as caught:
        Photograph.read(tmp_path / "p.jpg")
    assert caught.value.diagnostics[0].kind.code == "stage-photo" and "0x" not in str(caught.value)
    (tmp_path / "c.json").write_text('{"matrix": [1, 2]}')
    with pytest.raises(DataError) as caught:
        Lens.read(tmp_path / "c.json")
    assert "calibrated camera" in caught.value.diagnostics[0].text("title")


def test_the_overlay_is_drawn_where_outlines_are_seen(stage, scene, plain):
    import io

    from PIL import Image

    start, _ = scene
    photo = Photograph.from_picture(plain[0], "p.jpg")
    camera = find_camera(stage, photo)
    data = draw_overlay(stage, start, photo, camera, rendered=False)
    drawn = np.asarray(Image.open(io.BytesIO(data))).astype(int)
    assert drawn.shape == (*plain[0].shape, 3)
    pose = start.task.scenes.poses[start.row][0]
    u, v = camera.project(np.array([[pose[0] + 0.022, pose[1], 0.0]]))[0].round().astype(int)
    around = drawn[v - 4 : v + 5, u - 4 : u + 5]
    assert (around[..., 0] - around[..., 2]).max() > 150, "orange, on grey"
