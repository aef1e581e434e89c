"""Requests that cannot be: ranges of phi, counts, times, names."""

import pytest

# name -> (the words of --phi, the place that the caret points to)
RANGES = {
    "reversed": (["0.2:0"], "1:1"),
    "reversed_of_a_label": (["task=0.2:0"], "1:6"),
    "not_a_number": (["low:0.5"], "1:1"),
    "not_a_number_at_the_end": (["task=0.1:high"], "1:10"),
    "nan": (["nan:1"], "1:1"),
    "infinite": (["0:1e999"], "1:3"),
    "single_value": (["0.1:0.1"], "1:1"),
    "single_number": (["0.1"], "1:1"),
    "word": (["easy"], "1:1"),
    "nothing": ([""], "1:1"),
    "open_at_both_ends": ([":"], "1:1"),
    "three_ends": (["0:1:2"], "1:1"),
    "misspelt_label": (["tsak=0:1"], "1:1"),
    "unknown_label": (["difficulty=0:1"], "1:1"),
    "no_label_before_the_sign": (["=0:1"], "1:1"),
    "label_twice": (["task=0:1", "task=0:0.5"], "1:1"),
    "out_of_reach": (["1.5:2"], "1:1"),
    "out_of_reach_below": ([":-1.01"], "1:1"),
}
# name -> other words of `sample good.spec`
OTHERS = {
    "n_zero": ["-n", "0"],
    "n_negative": ["-n", "-3"],
    "n_enormous": ["-n", "100000000000"],
    "n_no_number": ["-n", "abc"],
    "n_fraction": ["-n", "1.5"],
    "seed_negative": ["--seed", "-1"],
    "seed_no_number": ["--seed", "x"],
    "n_too_many_for_json": ["-n", "2000000"],
    "workers_zero": ["--workers", "0"],
    "workers_no_number": ["--workers", "all"],
    "raw_and_resume": ["--raw", "--resume"],
    "timeout_zero": ["--timeout", "0"],
    "timeout_nan": ["--timeout", "nan"],
    "timeout_no_number": ["--timeout", "soon"],
    "method_misspelt": ["--method", "rejektion"],
    "method_without_model": ["--method", "model"],
    "raw_without_model": ["--raw"],
    "spread_misspelt": ["--spread", "flatt"],
    "spec_without_model": ["--spec", "two.spec"],
    "ending_unknown": ["--out", "o.xlsx"],
    "ending_misspelt": ["--out", "o.jsn"],
    "ending_missing": ["--out", "scenes"],
}


@pytest.mark.parametrize("name", RANGES)
def test_range(name, refused, golden):
    texts, place = RANGES[name]
    said = refused("sample", "good.spec", "--out", "o.json", *(word for text in texts for word in ("--phi", text)))
    assert said.splitlines()[1].strip() == f"--> --phi:{place}"
    golden(f"cli/errors/phi_{name}.txt", said)


def test_a_range_needs_its_label_where_there_are_two(refused, golden):
    said = refused("sample", "two.spec", "--phi", "0:0.1")
    assert "--> --phi:1:1" in said
    golden("cli/errors/phi_of_which_label.txt", said)


def test_nothing_to_resume_on_standard_output(refused, golden):
    golden("cli/errors/sample_resume_without_out.txt", refused("sample", "good.spec", "--resume"))


@pytest.mark.parametrize("name", OTHERS)
def test_option(name, refused, golden):
    golden(f"cli/errors/sample_{name}.txt", refused("sample", "good.spec", "--out", "o.json", *OTHERS[name]))


TRAIN = {
    "model": ["--model", "gann"],
    "epochs": ["--epochs", "0"],
    "epochs_no_number": ["--epochs", "many"],
    "recipe": ["--recipe", "papr"],
    "model_of_recipe": ["--recipe", "paper", "--model", "energy"],
    "data": ["--data", "boostd"],
    "device": ["--device", "gpu"],
    "hyper": ["--hyper", "widht=64"],
    "hyper_no_number": ["--hyper", "width=wide"],
    "hyper_twice": ["--hyper", "width=64", "--hyper", "width=32"],
    "hyper_range": ["--hyper", "width=0"],
    "nothing_to_resume": ["--resume"],
}


@pytest.mark.parametrize("name", TRAIN)
def test_train_option(name, refused, golden):
    words = ["train", "good.spec", "--model", "gan", "--out", "m.safetensors", *TRAIN[name]]
    golden(f"cli/errors/train_{name}.txt", refused(*words))


@pytest.mark.parametrize("size", ["640", "640x", "axb", "0x0", "100000x5", "640X480x3"])
def test_render_size(size, refused, scenegen):
    scenegen("sample", "good.spec", "-n", "1", "--out", "s.json")
    refused("render", "s.json", "--out", "pictures", "--size", size)


def test_render_size_points_at_the_option(refused, scenegen, golden):
    scenegen("sample", "good.spec", "-n", "1", "--out", "s.json")
    golden("cli/errors/render_size.txt", refused("render", "s.json", "--out", "pictures", "--size", "wide"))
    golden("cli/errors/render_size_small.txt", refused("render", "s.json", "--out", "pictures", "--size", "5x5"))
    golden("cli/errors/render_workers.txt", refused("render", "s.json", "--out", "pictures", "--workers", "0"))


USAGE = {
    "unknown_option": ["sample", "good.spec", "--nonsense"],
    "option_misspelt": ["check", "good.spec", "--jsn"],
    "missing_argument": ["sample", "--phi", "0:1"],
    "missing_second_argument": ["eval", "good.spec"],
    "missing_option": ["train", "good.spec", "--model", "gan"],
    "missing_value": ["sample", "good.spec", "-n"],
    "extra_argument": ["eval", "good.spec", "a.json", "b.json"],
    "unknown_command": ["sampel", "good.spec"],
}


@pytest.mark.parametrize("name", USAGE)
def test_wrong_usage_is_status_2(name, scenegen, here, golden):
    outcome = scenegen(*USAGE[name])
    assert (outcome.status, outcome.out) == (2, "")
    assert sorted(path.name for path in here.iterdir()) == ["forks.spec", "good.spec", "two.spec"]
    golden(f"cli/errors/usage_{name}.txt", outcome.err)


def test_an_unknown_model_is_refused_before_anything_is_loaded(here):
    """It took as long as loading torch, 17 seconds on a slow disk."""
    import subprocess
    import sys

    program = (
        "import sys; from scenegen.cli.app import run; status = run(sys.argv[1:]);"
        "print(status, [name for name in ('torch', 'lark') if name in sys.modules])"
    )
    words = ["train", "good.spec", "--model", "diffusion", "--out", "m.safetensors"]
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True, timeout=60)
    assert done.stdout == "1 []\n" and "`energy`" in done.stderr and "did you mean" not in done.stderr


def test_a_format_that_is_not_there(refused, scenegen, here):
    assert scenegen("sample", "good.spec", "-n", "1", "--out", "s.json").status == 0
    said = refused("export", "s.json", "--to", "gltf", "--out", "worlds")
    assert "the formats are `mjcf`, `sdf`" in said and "did you mean" not in said


@pytest.mark.long
def test_no_range_is_blamed_for_what_the_spec_requires(refused, here):
    text = "object a[4] = box(0.48, 0.48, 0.1)\nrequire noOverlap() & insideWorkspace()\ntask: leftOf(a[1], a[2])\n"
    (here / "tight.spec").write_text(text)
    words = ("--phi", "0:", "-n", "4", "--method", "rejection", "--timeout", "1.5", "--out", "x.json")
    said = refused("sample", "tight.spec", *words)
    assert "phi of `require` was outside" in said and "= help: require less" in said and "widen" not in said
