"""A few scenes of a request, soon and without a plan: for programs in which somebody waits for something to look at."""

from __future__ import annotations

from collections.abc import Mapping

from scenegen.api.request import Phi, check_request, read_phi, request_data
from scenegen.api.scene_arrays import make_header, stored_rows
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec
from scenegen.pose import as_poses, row_count
from scenegen.sampling.request import FixedPose, SampleRequest


def glimpse(
    spec: Spec,
    phi: Phi | None = None,
    n: int = 4,
    *,
    seed: int = 0,
    fix: Mapping[str, FixedPose | tuple[float, ...]] | None = None,
    timeout: float = 5.0,
) -> SceneSet:
    """At most n scenes in the wanted ranges, the arguments as `scenegen.sample` takes them; none where nothing is found
    soon. They are in range, but not distributed in any particular way, and not those that `sample` returns. Raises
    RequestError for a request that is wrong or proved to be impossible."""
    from scenegen.sampling.growth.glimpse import ROUNDS
    from scenegen.sampling.growth.glimpse import glimpse as grown
    from scenegen.sampling.problem import Budget, make_problem

    wanted = {} if fix is None else fix
    request = SampleRequest(read_phi(spec, phi), n, seed=seed, method="growth", fix=wanted, timeout=timeout)
    budget = Budget(timeout)
    problem = make_problem(spec.checked, check_request(spec, request), budget, rounds=ROUNDS, most=n)
    rows = grown(problem, budget, n)
    found = problem.phi(rows)
    header = make_header(spec.checked, {"method": "glimpse", "seed": seed}, request_data(problem.request))
    count = row_count(len(spec.objects))
    on = stored_rows(spec.checked, rows)[count:].T if spec.checked.choices else None
    return SceneSet(as_poses(rows[:count]), dict(zip(spec.labels, found, strict=False)), header, on=on, trusted=True)
