"""Documents of a training for one scene: what its folder holds beside every training's files.

scene.toml      the scene                      policy.json    what the best policy built, and when
layout.csv/json the row it builds              result.png     learning curve and row
tensorboard/    the losses too, where TensorBoard is installed
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta

from agents.base import run_files
from agents.base.run_files import CONFIG, ProgressDocument, Score, Seed
from agents.sb3.presets import ALGORITHMS, Preset
from domino_env.core.models import Document, model_of
from domino_env.core.reading import naming, read_json

SCENE, BUILT = "scene.toml", "policy.json"
FILES = (*run_files.FILES, SCENE, BUILT, "layout.csv", "layout.json", "result.png")
OPTIONS = (
    "alive_bonus_offset", "batch_size", "clip_range", "clip_range_vf", "delta_std",
    "ent_coef", "gae_lambda", "gamma", "max_grad_norm",
    "n_delta", "n_epochs", "n_eval_episodes", "n_steps", "n_top", "normalize_advantage",
    "target_kl",     "vf_coef",
    "zero_policy",
)  # fmt: skip
"""What a file may ask of an algorithm: numbers.  Not where it writes, nor what code it runs."""

if TYPE_CHECKING:
    Algorithm = str
else:
    Algorithm = Literal[ALGORITHMS]

Option = (
    Annotated[int, Meta(ge=-(10**15), le=10**15)]
    | Annotated[float, Meta(ge=-1e15, le=1e15)]
    | Annotated[str, Meta(pattern=r"^auto(_[0-9.]{1,8})?$")]
    | bool
    | None
)


class ConfigDocument(Document):
    """What a run was begun with: config.json."""

    algorithm: Algorithm
    seed: Seed
    steps: Annotated[int, Meta(ge=1, le=10**15)]
    preset: Preset


class BuiltDocument(Document):
    """What is needed of policy.json."""

    reference_over_uniform: Annotated[
        float,
        Meta(gt=0, le=1000, description="speed that the policy is used to, over the uniform row's"),
    ]


class SceneProgressDocument(ProgressDocument, kw_only=True):
    """How far a training for one scene had come, in its checkpoint."""

    best: Score
    sampled: Score
    reference: Score


def read_config(folder: Path) -> ConfigDocument:
    """Read the config.json of a run; ValueError, naming it, for anything else."""
    path = folder / CONFIG
    with naming(path):
        config = model_of(ConfigDocument, read_json(path))
        for key, value in config.preset.options.items():
            if key not in OPTIONS:
                raise ValueError(f"unknown key 'preset.options.{key}': allowed: {OPTIONS}")
            model_of(Option, value, f"preset.options.{key}")  # type: ignore[arg-type]
    return config


def read_reference(folder: Path) -> float:
    """Read the speed that the policy of a run is used to, over the uniform row's."""
    path = folder / BUILT
    with naming(path):
        return model_of(BuiltDocument, read_json(path)).reference_over_uniform
