"""Seconds per epoch of the published GAN and AAE on experiment 1, beside a plain loop in the same run and the published
figures; and milliseconds per step of `flow` beside the arithmetic that a step cannot do without.

    python benchmarks/training.py [--epochs 5]

One epoch is 625 steps of batch 32 over 20,000 scenes, on one thread. "plain" is our own straightforward loop in the
style of published training code: a DataLoader with batch 32 and shuffle, autograd, plain Adam, losses read with .item()
at every step. "arithmetic" is the floor: the matrix products of a step alone, in their real shapes, and Adam's one pass
over the weights, with nothing around them. Times are CPU seconds of this process, the median over the epochs. A step
of `flow` is one of its own batches of 512 scenes.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn.functional import binary_cross_entropy as bce
from torch.utils.data import DataLoader, TensorDataset

from experiments.published import register
from scenegen.lang.checker import check_file
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.codec import Codec
from scenegen.learn.training.config import make_config
from scenegen.learn.training.dataset import uniform
from scenegen.learn.training.feed import make_feed
from scenegen.learn.training.loop import train
from scenegen.learn.training.session import TrainingSession
from scenegen.resources import shipped_specs

BATCH, STEPS = 32, 625
PUBLISHED = {"gan": (1.4, 1.6), "aae": (2.65, 3.6)}  # CPU seconds per epoch of the published loop, one core
GENERATOR = (258, 256, 128, 128, 64, 64, 6)
ENCODER, DECODER = (6, 64, 64, 128, 128, 256, 16), (18, 256, 128, 128, 64, 64, 6)


def judge_widths(inputs: int) -> tuple[int, ...]:
    return (inputs, 128, 128, 64, 64, 32, 32, 1)


def shipped(name: str) -> CheckedSpec:
    path = shipped_specs()[name]
    return check_file(path, path.read_bytes())


def exp1() -> CheckedSpec:
    return shipped("mug_left_of_plate")


def network(widths: tuple[int, ...], act: Callable[[], nn.Module]) -> nn.Sequential:
    layers: list[nn.Module] = []
    for a, b in pairwise(widths):
        layers += [nn.Linear(a, b), act()]
    return nn.Sequential(*layers[:-1], nn.Sigmoid())


def plain_gan(lr: float = 1e-3) -> Callable[[Tensor, Tensor], tuple[float, ...]]:
    maker = network(GENERATOR, nn.ReLU)
    judge = network(judge_widths(8), lambda: nn.LeakyReLU(0.2))
    adam_g = torch.optim.Adam(maker.parameters(), lr=lr, betas=(0.5, 0.999))
    adam_d = torch.optim.Adam(judge.parameters(), lr=lr, betas=(0.5, 0.999))

    def step(x: Tensor, phi: Tensor) -> tuple[float, ...]:
        rows = len(x)
        real, fake = torch.ones(rows, 1), torch.zeros(rows, 1)
        adam_g.zero_grad()
        z, labels = torch.randn(rows, 256), torch.rand(rows, 2) * 2.0 - 1.0
        made = maker(torch.cat([z, labels], 1))
        loss_g = bce(judge(torch.cat([made, labels], 1)), real)
        torch.autograd.backward(loss_g)
        adam_g.step()
        adam_d.zero_grad()
        on_real = bce(judge(torch.cat([x, phi], 1)), real)
        on_fake = bce(judge(torch.cat([made.detach(), labels], 1)), fake)
        loss_d = (on_real + on_fake) / 2
        torch.autograd.backward(loss_d)
        adam_d.step()
        return loss_g.item(), loss_d.item()

    return step


def plain_aae(lr: float = 1e-3) -> Callable[[Tensor, Tensor], tuple[float, ...]]:
    encoder = network(ENCODER, nn.ReLU)[:-1]
    decoder, judge = network(DECODER, nn.ReLU), network(judge_widths(16), lambda: nn.LeakyReLU(0.2))
    adam_r = torch.optim.Adam([*encoder.parameters(), *decoder.parameters()], lr=lr)
    adam_d = torch.optim.Adam(judge.parameters(), lr=lr)
    adam_e = torch.optim.Adam(encoder.parameters(), lr=lr)

    def step(x: Tensor, phi: Tensor) -> tuple[float, ...]:
        rows = len(x)
        real, fake = torch.ones(rows, 1), torch.zeros(rows, 1)
        adam_r.zero_grad()
        squares = ((decoder(torch.cat([encoder(x), phi + 1.0], 1)) - x) ** 2).sum()
        torch.autograd.backward(squares)
        adam_r.step()
        adam_d.zero_grad()
        loss_d = (bce(judge(torch.randn(rows, 16)), real) + bce(judge(encoder(x).detach()), fake)) / 2
        torch.autograd.backward(loss_d)
        adam_d.step()
        adam_e.zero_grad()
        loss_e = bce(judge(encoder(x)), real)
        torch.autograd.backward(loss_e)
        adam_e.step()
        return squares.item(), loss_d.item(), loss_e.item()

    return step


def plain_epochs(model: str, epochs: int) -> list[float]:
    spec = exp1()
    data = uniform(spec, BATCH * STEPS, torch.Generator().manual_seed(0))
    pairs = TensorDataset(Codec(spec.workspace, 2).encode(data.rows), data.phi.T.contiguous())
    loader = DataLoader(pairs, batch_size=BATCH, shuffle=True)
    step = {"gan": plain_gan, "aae": plain_aae}[model]()
    took = []
    for _ in range(epochs):
        began = time.process_time()
        for x, phi in loader:
            step(x, phi)
        took.append(time.process_time() - began)
    return took


def our_epochs(model: str, epochs: int) -> list[float]:
    marks: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        config = make_config(f"paper-{model}", epochs=epochs + 1)
        train(exp1(), config, Path(folder) / "m", on_epoch=lambda report: marks.append(time.process_time()))
    return [after - before for before, after in pairwise(marks)]


def flow_step(name: str, steps: int = 50) -> tuple[float, float]:
    """Milliseconds of a step of `flow` on a shipped spec, and of its arithmetic."""
    spec = shipped(name)
    config = make_config("flow", data="uniform", scenes=2 * steps * 512)
    session = TrainingSession(spec, config, make_feed(spec, config), None)
    took = []
    for index, batch in enumerate(session.batches()):
        began = time.process_time()
        session.update(batch)
        if index >= steps:  # the first half warms up
            took.append(time.process_time() - began)
    work: list[Callable[[], object]] = []
    for layer in session.model.flow.body.linear():
        wide, narrow = layer.in_features, layer.out_features
        x, w, bias, y = torch.rand(512, wide), torch.rand(narrow, wide), torch.rand(narrow), torch.rand(512, narrow)
        gx, gw = torch.empty_like(x), torch.empty_like(w)
        work.append(partial(torch.addmm, bias, x, w.t(), out=y))
        work.append(partial(torch.mm, y.t(), x, out=gw))
        work.append(partial(torch.mm, y, w, out=gx))
    weights = [nn.Parameter(torch.rand_like(one)) for one in session.model.parameters()]
    for one in weights:
        one.grad = torch.rand_like(one)
    work.append(torch.optim.Adam(weights, fused=True).step)
    return statistics.median(took) * 1e3, timed(work, 30) * 1e3


def timed(work: list[Callable[[], object]], rounds: int) -> float:
    """CPU seconds of all of the work once, after a warm-up."""
    for _ in range(max(1, rounds // 10)):
        for call in work:
            call()
    began = time.process_time()
    for _ in range(rounds):
        for call in work:
            call()
    return (time.process_time() - began) / rounds


def arithmetic(model: str) -> float:
    """Seconds that an epoch's matrix products and Adam passes take alone."""
    judge = judge_widths(8 if model == "gan" else 16)
    # (widths, rows, forward passes, weight gradients, input gradients) per step
    passes = {
        "gan": [(GENERATOR, BATCH, 1, 1, 1), (judge, 2 * BATCH, 1, 1, 1), (judge, BATCH, 0, 0, 1)],
        "aae": [
            (ENCODER, BATCH, 2, 2, 2),
            (DECODER, BATCH, 1, 1, 1),
            (judge, 2 * BATCH, 1, 1, 1),
            (judge, BATCH, 1, 0, 1),
        ],
    }[model]
    adam = {"gan": [GENERATOR, judge], "aae": [ENCODER, DECODER, judge, ENCODER]}[model]
    work: list[Callable[[], object]] = []
    for widths, rows, forward, weights, inputs in passes:
        for a, b in pairwise(widths):
            x, w, bias, y = torch.rand(rows, a), torch.rand(b, a), torch.rand(b), torch.rand(rows, b)
            gx, gw = torch.empty_like(x), torch.empty_like(w)
            work += [partial(torch.addmm, bias, x, w.t(), out=y)] * forward
            work += [partial(torch.mm, y.t(), x, out=gw)] * weights
            work += [partial(torch.mm, y, w, out=gx)] * inputs
    for widths in adam:
        vector = nn.Parameter(torch.rand(sum(a * b + b for a, b in pairwise(widths))))
        vector.grad = torch.rand_like(vector)
        work.append(torch.optim.Adam([vector], fused=True).step)
    return timed(work, 200) * STEPS


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--epochs", type=int, default=5, help="epochs to time of each loop")
    epochs = parser.parse_args().epochs
    torch.set_num_threads(1)
    register()
    out = sys.stdout
    out.write("CPU seconds per epoch (625 steps of batch 32, one thread)\n\n")
    out.write("| model | scenegen | plain loop | plain / scenegen | published | published / scenegen | arithmetic |\n")
    out.write("|---|---|---|---|---|---|---|\n")
    for model, (low, high) in PUBLISHED.items():
        # By turns, so that another load on the machine meets both alike.
        rounds = [(our_epochs(model, epochs), plain_epochs(model, epochs)) for _ in range(2)]
        ours = statistics.median(second for mine, _ in rounds for second in mine)
        plain = statistics.median(second for _, theirs in rounds for second in theirs)
        out.write(
            f"| {model} | {ours:.2f} | {plain:.2f} | {plain / ours:.1f} | {low}-{high} "
            f"| {low / ours:.1f}-{high / ours:.1f} | {arithmetic(model):.2f} |\n"
        )
        out.flush()
    out.write("\nCPU milliseconds per step of `flow` (batch 512, one thread)\n\n")
    out.write("| spec | scenegen | arithmetic | share of arithmetic |\n|---|---|---|---|\n")
    for name in ("mug_left_of_plate", "table_setting", "sort_7"):
        mine, floor = flow_step(name)
        out.write(f"| {name} | {mine:.1f} | {floor:.1f} | {100 * floor / mine:.0f} % |\n")
        out.flush()


if __name__ == "__main__":
    main()
