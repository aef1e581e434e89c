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
from scenegen.play.stage import overlay  # noqa: E402
from scenegen.play.stage.camera import Lens, Photograph, find_camera  # noqa: E402
from scenegen.play.stage.measure import measure_poses, poses_by_tags  # noqa: E402
from scenegen.play.stage.overlay import draw_overlay, render_start  # noqa: E402

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


@pytest.mark.parametrize("covered", [(1,), (1, 3), (0, 1, 3)], ids=len)
def test_tags_of_the_mat_that_are_covered(stage, scene, draw, covered):
    start, poses = scene
    photo = Photograph.from_picture(draw(covered=covered)[0], "p.jpg")
    camera = find_camera(stage, photo, None, start)
    off = poses_by_tags(stage, start, photo, camera) - poses
    assert np.hypot(*off[:, :2].T).max() < 0.003 and abs(np.degrees(off[:, 2])).max() < 1.0
    errors = [camera.place_error(photo.tags[thing.tag], height) for thing, height in stage.tops(start)]
    assert 0.0 < max(errors) < 0.003 and np.hypot(*off[:, :2].T).max() < 4.0 * max(errors)


def test_a_picture_that_hardly_tells_where_things_are(stage, scene, draw, tmp_path):
    start, _ = scene
    path, clicks = tmp_path / "p.png", tmp_path / "c.csv"
    cv2.imwrite(str(path), draw(covered=(0, 1, 3), tags=[None] * 3)[0])
    clicks.write_text("object,u,v\n")
    with pytest.raises(DataError) as caught:
        measure_poses(stage, start, photo=path, corners=clicks)
    assert "shows 1 of the 4 tags of the mat: places are good to" in caught.value.diagnostics[0].text("title")


def test_a_mat_that_is_bent_printed_smaller_or_another(stage, scene, draw):
    start, _ = scene
    assert "is not flat" in refusal(stage, start, draw(bend=0.03)[0])
    assert "was printed at 9" in refusal(stage, start, draw(scale=0.97)[0])
    assert "is that of another suite" in refusal(stage, start, draw(mat=grow_mat(stage, 0.05))[0])


def test_pictures_upside_down_mirrored_and_small(stage, scene, plain):
    start, poses = scene
    turned = Photograph.from_picture(plain[0][::-1, ::-1].copy(), "p.jpg")
    off = poses_by_tags(stage, start, turned, find_camera(stage, turned)) - poses
    assert np.hypot(*off[:, :2].T).max() < 0.003
    assert "is mirrored" in refusal(stage, start, plain[0][:, ::-1].copy())
    assert refusal(stage, start, cv2.resize(plain[0], (240, 180), interpolation=cv2.INTER_AREA))


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
    drawn = np.asarray(Image.open(io.BytesIO(draw_overlay(stage, start, photo, camera, "ok")))).astype(int)
    low, high = overlay._crop(camera.project(overlay._frame_corners(stage, start)), *plain[0].shape[::-1])
    zoom = overlay.PANE_HEIGHT / (high[1] - low[1])
    assert drawn.shape[0] == overlay.PANE_HEIGHT + 72 and drawn.shape[1] == round((high[0] - low[0]) * zoom)
    pose, shape = start.task.scenes.poses[start.row][0], start.task.spec.checked.shapes[0]
    for x, y in overlay.outline_at(shape, pose)[::8]:
        u, v = ((camera.project(np.array([[x, y, 0.0]]))[0] + 0.5 - low) * zoom).round().astype(int)
        around = drawn[v - 2 : v + 3, u - 2 : u + 3]
        assert (around[..., 0] - around[..., 2]).max() > 150, "orange, on grey"


def test_the_rendered_start_is_seen_by_the_same_camera(stage, scene, plain):
    pytest.importorskip("pybullet")
    start, _ = scene
    photo = Photograph.from_picture(plain[0], "p.jpg")
    camera = find_camera(stage, photo)
    pane = render_start(stage, start, camera)
    eye, target, _, _, roll = overlay._view_of(stage, start, camera)
    rendered = overlay.from_place(overlay._frame_corners(stage, start), pane.size, eye, target, 40.0, roll)
    assert np.allclose(rendered.eye, -camera.turn.T @ camera.shift)
    across = rendered.extrinsics()[0, :3] @ camera.turn[0]
    assert across > 0.97, "to the right is to the right"


def test_a_video_is_drawn_until_it_ends(stage, scene, plain, tmp_path, warm):
    start, _ = scene
    for number, one in enumerate((np.zeros_like(plain[0]), plain[0])):
        cv2.imwrite(str(tmp_path / f"{number:04d}.png"), one)
    words = ["-m", "scenegen", "stage", "overlay", "tabletop", "--episodes", str(start.number), "--out", "o.png"]
    done = warm.run([*words, "--live", "%04d.png"], tmp_path)
    assert done.returncode == 0 and (tmp_path / "o.png").exists() and done.stderr.count("\n") == 2, done.stderr
    (tmp_path / "0001.png").unlink()
    (tmp_path / "o.png").unlink()
    done = warm.run([*words, "--live", "%04d.png"], tmp_path)
    assert done.returncode == 1 and "camera %04d.png shows no tag of the mat" in done.stderr
    done = warm.run([*words, "--live", "37"], tmp_path)
    assert done.returncode == 1 and done.stderr.startswith("error[stage-photo]: no picture comes from the camera `37`")
    assert done.stderr.count("\n") == 2 and not (tmp_path / "o.png").exists()
    done = warm.run([*words, "--live", "0", "--photo", "0000.png"], tmp_path)
    assert done.returncode == 1 and "does not go with --photo" in done.stderr
    done = warm.run(words, tmp_path)
    assert done.returncode == 1 and "or --live, a camera" in done.stderr
