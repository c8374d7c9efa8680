"""Learn to predict what of a map was never measured: a small U-Net, trained on missions of strategies.

    python -m training.map_predictor --out runs/map-predictor
    python -m training.map_predictor --leave-out office --out runs/without-office
    python -m training.map_predictor --weights runs/map-predictor/predictor.safetensors --out runs/again
    python -m training.map_predictor --recipes cave office-3d --out runs/volumes

Samples are cut from missions (`training.map_samples`), turned and mirrored at random. The loss is the log
loss of the cells in which nothing was measured, and of no others; the weights that are kept are a moving
average. The folder gets the samples, `training.safetensors` after every epoch, and at the end

    predictor.safetensors   the weights, read by `prediction.weights`
    predictor.json          options, and figures on worlds of validation (`training.map_scores`)
    predictor.png           partial maps, their predictions and the truth; a reliability diagram

The same command goes on where it was interrupted, and on a CPU it comes to the same weights. Dungeons are
public worlds: they are fetched, or read from the folder that ENTROPY_EXPLORE_WORLDS names.
"""

from __future__ import annotations

from training import extra  # noqa: F401 - before what is not there without it

# isort: split

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import nn
from torch.nn import functional

from baselines.cli.arguments import make_folder, parse, print_json, run_command
from baselines.cli.interruption import Interruption
from baselines.cli.worker_options import WorkerOptions
from entropy_explore_env.command import INTERRUPTED
from entropy_explore_env.errors import SettingError, counted, one_of
from entropy_explore_env.prediction.unet import LEVELS, Form, layer_shapes
from entropy_explore_env.prediction.weights import features_of, read_network
from entropy_explore_env.settings.validation import check_whole
from entropy_explore_env.version import VERSION
from entropy_explore_env.writing import write_atomically
from training.map_samples import (
    PLAN_RECIPES,
    RECIPES,
    Samples,
    drawn_batch,
    form_of,
    make_samples,
    read_samples,
    sampled_missions,
)
from training.map_scores import draw_figure, figures_of, nearest_shares, predictions, scored, table_text

_STOPPED = "this mission or epoch is done first; the same command goes on"
_AVERAGED = 0.998
"""Share of the moving average of the weights that stays at each step."""
_DECAY = 1e-4
_WARM = 0.05
"""Share of the steps in which the rate grows to its largest."""
_NEAREST_SAMPLES = 600
"""Samples of training from which the shares of the baseline `nearest` come."""
_REPORTED = ("recipes", "leave_out", "missions", "validation_missions", "snapshots", "epochs", "batch")
_OPTIONS = (*_REPORTED, "rate", "seed")
"""Options that determine the weights."""


@dataclass
class Args(WorkerOptions):
    """Learn to predict what of a map was never measured."""

    usual: ClassVar = (
        *("recipes", "leave_out", "out", "weights", "missions", "validation_missions", "snapshots"),
        *("epochs", "batch", "rate", "seed", "threads", "device", "jobs", "cluster", "json"),
    )

    recipes: tuple[str, ...] = PLAN_RECIPES
    """What worlds are learned from: office, corridor, cluttered, hybrid, dungeon; or the volumes cave,
    office-3d."""
    leave_out: str | None = None
    """One of these recipes that is not learned from; the figures tell of it all the same."""
    out: Path = Path("runs/map-predictor")
    """Folder of the run; the same command goes on with what is there."""
    weights: Path | None = None
    """A file of weights to be scored; nothing is learned then. Samples of a run in --out are used again."""
    missions: int = 250
    """Missions of training in each recipe."""
    validation_missions: int = 20
    """Missions of validation in each recipe."""
    snapshots: int = 16
    """Samples of a mission at most."""
    epochs: int = 40
    """How often all samples are learned from."""
    batch: int = 16
    """Samples of a step."""
    rate: float = 2e-3
    """Largest learning rate; it ends at 0."""
    seed: int = 0
    """Seed of missions, of weights and of the order of samples."""
    threads: int = 2
    """Threads for learning; sums may come out in another order with another number."""
    device: str = "auto"
    """PyTorch's device for learning; auto = cuda where there is one, else cpu. Another one gives slightly
    other weights."""
    json: bool = False
    """Print one JSON object and nothing else."""

    @property
    def form(self) -> Form:
        """What the network is."""
        return form_of(self.recipes[0])


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check(args)
    form = args.form
    network = None if args.weights is None else read_network(args.weights, form)
    workers = args.workers
    make_folder("out", args.out)
    if network is None:
        _taken_up(args)  # another run's options are refused before anything is sampled
    with Interruption(_STOPPED) as interruption:
        asked = {
            split: sampled_missions(args.recipes, split, count, args.snapshots, args.seed)
            for split, count in (("train", args.missions), ("validation", args.validation_missions))
        }
        every, folder = [*asked["validation"], *asked["train"]], args.out / "samples"
        for done, _ in enumerate(make_samples(every, folder, workers, interruption)):
            _tell(args, f"{counted(done + 1, 'mission')} sampled", done % 20 == 0)
        if interruption.asked:
            return _interrupted(args)
        learned = [each for each in asked["train"] if each.recipe != args.leave_out]
        samples, validation = read_samples(folder, learned)[0], read_samples(folder, asked["validation"])
        if network is None:
            model = train(args, samples, interruption)
            if model is None:
                return _interrupted(args)
            write_atomically(args.out / "predictor.safetensors", save(model.named(), features_of(form)))
            network = read_network(args.out / "predictor.safetensors", form)
    predicted = predictions(network, form, validation[0])
    every_nth = max(len(samples.truth) // _NEAREST_SAMPLES, 1)
    shares = nearest_shares(Samples(*(values[::every_nth] for values in samples)), form.cell_m)
    figures = figures_of(scored(*validation, form.cell_m, predicted, shares))
    told = {name: getattr(args, name) for name in (*_OPTIONS, "threads")}
    told["device"] = str(device_of(args))
    told |= {"weights": None if args.weights is None else args.weights.name, "version": VERSION}
    told |= {"samples": len(samples.truth), "validation_samples": len(validation[1])}
    results = {"options": told, "figures": figures}
    write_atomically(args.out / "predictor.json", json.dumps(results, indent=1, allow_nan=False) + "\n")
    draw_figure(args.out / "predictor.png", *validation, predicted, figures)
    if args.json:
        print_json(results)
    else:
        print(table_text(figures, args.leave_out))
    return 0


def check(args: Args) -> None:
    """Raise a SettingError where an option is out of its range."""
    if not args.recipes:
        raise SettingError("recipes", args.recipes, f"some of {', '.join(RECIPES)}")
    for name in args.recipes:
        if name not in RECIPES:
            raise SettingError("recipes", name, one_of(name, RECIPES))
    if len({form_of(name) for name in args.recipes}) > 1:
        raise SettingError("recipes", args.recipes, "plans alone, or volumes alone")
    if args.leave_out is not None and args.leave_out not in args.recipes:
        raise SettingError("leave_out", args.leave_out, one_of(args.leave_out, args.recipes))
    if args.recipes == (args.leave_out,):
        raise SettingError("leave_out", args.leave_out, "not the only recipe")
    for name in ("missions", "validation_missions", "snapshots", "epochs", "batch", "threads"):
        check_whole(name, getattr(args, name), 1)
    check_whole("seed", args.seed, 0)
    device_of(args)
    if not 0.0 < args.rate < math.inf:
        raise SettingError("rate", args.rate, "a number above 0")


def device_of(args: Args) -> torch.device:
    """Return the device on which a network learns.

    Raises:
        SettingError: PyTorch does not know it, or has no such device here.
    """
    if args.device == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    try:
        torch.ones(1, device=args.device).item()  # a device without memory has no numbers
    except (RuntimeError, AssertionError, ImportError):
        raise SettingError("device", args.device, "auto, cpu, or a device that PyTorch has here") from None
    return torch.device(args.device)


def _tell(args: Args, text: str, now: bool = True) -> None:
    """Tell of progress, beside the results."""
    if now and not args.json:
        print(text, file=sys.stderr, flush=True)


def _interrupted(args: Args) -> int:
    print(f"stopped; the same command goes on with what is in {args.out}", file=sys.stderr)
    return INTERRUPTED


class UNet(nn.Module):
    """The network of `prediction.unet`, for learning."""

    def __init__(self, form: Form) -> None:
        """Draw weights as PyTorch does."""
        super().__init__()
        shapes = layer_shapes(form)
        self.first, self.second, self.lift, self.merge = (
            nn.ModuleList(
                nn.Conv2d(inputs, outputs, math.isqrt(taps), padding=math.isqrt(taps) // 2)
                for name, (outputs, inputs, taps) in shapes.items()
                if name.startswith(f"{part}.")
            )
            for part in ("first", "second", "lift", "merge")
        )
        outputs, inputs, _ = shapes["head"]
        self.head = nn.Conv2d(inputs, outputs, 1)

    def forward(self, cells: torch.Tensor) -> torch.Tensor:
        """Return the logits (B, L, C, C) of cells (B, 2·L + 1, C, C)."""
        values, finer = functional.pixel_unshuffle(cells, 2), []
        for level in range(LEVELS):
            if level > 0:
                values = functional.max_pool2d(values, 2)
            values = functional.relu(self.first[level](values))
            values = functional.relu(self.second[level](values))
            finer.append(values)
        for level in range(LEVELS - 2, -1, -1):
            lifted = functional.interpolate(self.lift[level](values), scale_factor=2, mode="nearest")
            values = functional.relu(self.merge[level](finer[level] + lifted))
        return functional.pixel_shuffle(self.head(values), 2)

    def named(self) -> dict[str, torch.Tensor]:
        """Return the weights by name, each in memory of its own."""
        return {name: values.detach().contiguous().clone() for name, values in self.state_dict().items()}


def masked_loss(logits: torch.Tensor, truth: torch.Tensor, asked: torch.Tensor) -> torch.Tensor:
    """Return the mean log loss, nats, of the cells that are asked for; all (B, L, C, C)."""
    losses = functional.binary_cross_entropy_with_logits(logits, truth, reduction="none")
    return (losses * asked).sum() / asked.sum().clamp(min=1.0)


def rate_at(args: Args, step: int, steps: int) -> float:
    """Return the learning rate: a linear rise, then half a cosine down to 0."""
    share = (step + 1) / steps
    if share < _WARM:
        return args.rate * share / _WARM
    return args.rate * 0.5 * (1.0 + math.cos(math.pi * (share - _WARM) / (1.0 - _WARM)))


def train(args: Args, samples: Samples, interruption: Interruption) -> UNet | None:
    """Return a trained network, the moving average of its weights; None if Ctrl-C stopped that."""
    torch.set_num_threads(args.threads)
    torch.manual_seed(args.seed)
    device, model = device_of(args), UNet(args.form)
    model.to(device, memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue] - twice as fast
    cells, truth = (torch.from_numpy(values).to(device) for values in samples)
    optimiser = torch.optim.AdamW(model.parameters(), lr=args.rate, weight_decay=_DECAY)
    average = model.named()
    count = len(samples.truth)
    begun = _resume(args, model, optimiser, average)
    steps_each = math.ceil(count / args.batch)
    for epoch in range(begun, args.epochs):
        rng, total = np.random.default_rng([args.seed, epoch]), torch.zeros((), device=device)
        order = torch.from_numpy(rng.permutation(count)).to(device)
        for place in range(steps_each):
            step = epoch * steps_each + place
            for group in optimiser.param_groups:
                group["lr"] = rate_at(args, step, args.epochs * steps_each)
            chosen = order[place * args.batch : (place + 1) * args.batch]
            channels, solid, asked = drawn_batch(cells, truth, chosen, rng)
            loss = masked_loss(model(channels), solid, asked)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            total += loss.detach()
            kept = min(_AVERAGED, (1.0 + step) / (10.0 + step))
            with torch.no_grad():
                for name, values in model.state_dict().items():
                    average[name].lerp_(values, 1.0 - kept)
        bits = float(total) / steps_each / math.log(2.0)
        if not math.isfinite(bits):
            raise SettingError(
                "rate", args.rate, f"a rate at which the loss stays finite (epoch {epoch + 1})"
            )
        _save(args, epoch + 1, model, optimiser, average)
        _tell(args, f"epoch {epoch + 1} of {args.epochs}: {bits:.4f} bits a cell")
        if interruption.asked and epoch + 1 < args.epochs:
            return None
    model.load_state_dict(average)
    return model


def _state(
    model: UNet, optimiser: torch.optim.AdamW, average: dict[str, torch.Tensor]
) -> dict[str, torch.Tensor]:
    """Return all that learning goes on with, by name."""
    tensors = {f"model.{name}": values for name, values in model.named().items()}
    tensors |= {f"average.{name}": values for name, values in average.items()}
    for number, state in optimiser.state_dict()["state"].items():
        tensors |= {f"adam.{number}.{name}": values.contiguous().clone() for name, values in state.items()}
    return tensors


def _save(
    args: Args,
    epochs: int,
    model: UNet,
    optimiser: torch.optim.AdamW,
    average: dict[str, torch.Tensor],
) -> None:
    """Write down how far learning is."""
    about = {"epochs": str(epochs), "origin": _origin(args)}
    write_atomically(_training_file(args), save(_state(model, optimiser, average), about))


def _training_file(args: Args) -> Path:
    return args.out / "training.safetensors"


def _origin(args: Args) -> str:
    """Return the options that determine the weights, as JSON."""
    return json.dumps({name: getattr(args, name) for name in _OPTIONS} | features_of(args.form))


def _taken_up(args: Args) -> tuple[int, dict[str, torch.Tensor]]:
    """Return how many epochs are done and the tensors that `_save` wrote, if any.

    Raises:
        SettingError: The file is of other options, or broken.
    """
    file = _training_file(args)
    if not file.is_file():
        return 0, {}
    try:
        with safe_open(file, "pt") as opened:
            about: dict[str, Any] = opened.metadata() or {}
            tensors = {name: opened.get_tensor(name) for name in opened.keys()}
    except (OSError, SafetensorError):
        raise SettingError(
            "out", str(file), "a file that this command wrote: remove it to begin anew"
        ) from None
    theirs = {"layers": "1", **json.loads(about.get("origin", "{}"))}
    for name, value in json.loads(_origin(args)).items():
        if theirs.get(name) != value:
            allowed = f"{theirs.get(name)!r} as in the run in {args.out}, or another folder --out"
            raise SettingError(name, value, allowed)
    return int(about["epochs"]), tensors


def _resume(args: Args, model: UNet, optimiser: torch.optim.AdamW, average: dict[str, torch.Tensor]) -> int:
    """Take up what `_save` wrote, if anything; return how many epochs are done."""
    epochs, tensors = _taken_up(args)
    if epochs == 0:
        return 0
    model.load_state_dict(_below("model.", tensors))
    for name, values in _below("average.", tensors).items():
        average[name].copy_(values)
    state: dict[int, dict[str, torch.Tensor]] = {}
    for name, values in _below("adam.", tensors).items():
        number, _, what = name.partition(".")
        state.setdefault(int(number), {})[what] = values
    optimiser.load_state_dict({"state": state, "param_groups": optimiser.state_dict()["param_groups"]})
    return epochs


def _below(prefix: str, tensors: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Return the tensors whose names begin with a prefix, by the rest of their names."""
    return {name.removeprefix(prefix): each for name, each in tensors.items() if name.startswith(prefix)}


if __name__ == "__main__":
    raise SystemExit(run_command(main))
