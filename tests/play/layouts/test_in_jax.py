"""The recipes of docs/layouts.md for MuJoCo Playground, with the real JAX and MJX: `make test-fetch` installs them.
Playground itself fetches its robots from the network, and was not run."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

import scenegen
from scenegen.layouts import Layouts
from tests.play.layouts.recipes import recipe

jax = pytest.importorskip("jax")
pytestmark = pytest.mark.filterwarnings("ignore:.*")  # JAX's own

SPEC = scenegen.parse(
    "object red = box(4 cm, 4 cm, 4 cm), blue\nrequire noOverlap()\ntask: closeTo(red, blue, 30 cm)\n"
)
BODY = '<body name="{}"><freejoint/><geom type="box" size=".02 .02 .02"/></body>'


@pytest.fixture
def pool():
    layouts = Layouts(SPEC, (0.0, None), quaternion="wxyz", ahead=16, device=None)
    return jax.numpy.asarray(layouts.take(16).poses)


def test_a_start_is_one_of_the_pool(pool):
    begun = jax.jit(lambda rng: recipe("start")(rng, jax.numpy.zeros(20), pool, (9, 1)))(jax.random.PRNGKey(0))
    found = [bool((begun[9:16] == one[0]).all() and (begun[1:8] == one[1]).all()) for one in pool]
    assert sum(found) == 1 and not begun[0] and not begun[16:].any()


def test_a_state_has_the_objects_where_the_start_has_them(pool):
    """A state with what Playground's have, of a model with two boxes."""
    mjx = pytest.importorskip("mujoco.mjx")
    import mujoco

    @dataclass(frozen=True)
    class State:
        data: object
        obs: object
        info: dict
        replace = replace

    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{BODY.format('red')}{BODY.format('blue')}</worldbody></mujoco>"
    )
    env = SimpleNamespace(mjx_model=mjx.put_model(model), _get_obs=lambda data, info: data.xpos[1:])
    starts = set()
    for key in (1, 2, 1):
        state = State(mjx.make_data(model), None, {"rng": jax.random.PRNGKey(key)})
        begun = recipe("start", "started")(env, state, pool, (0, 7))
        assert min(float(abs(begun.obs - one[:, :3]).max()) for one in pool) < 1e-6
        starts.add(np.asarray(begun.obs).tobytes())
    assert len(starts) == 2
