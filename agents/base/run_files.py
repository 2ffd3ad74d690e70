"""Run files: what a training keeps in its folder, as models of the documents."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from msgspec import Meta

from agents.sb3.presets import ALGORITHMS, Preset
from domino_env.support.models import Document, model_of
from domino_env.support.reading import naming, read_json

OPTIONS = (
    "alive_bonus_offset", "batch_size", "buffer_size", "clip_range", "clip_range_vf", "delta_std",
    "ent_coef", "gae_lambda", "gamma", "gradient_steps", "learning_starts", "max_grad_norm",
    "n_delta", "n_epochs", "n_eval_episodes", "n_steps", "n_top", "normalize_advantage",
    "policy_delay", "target_entropy", "target_kl", "target_noise_clip", "target_policy_noise",
    "target_update_interval", "tau", "top_quantiles_to_drop_per_net", "train_freq", "vf_coef",
    "zero_policy",
)  # fmt: skip
"""What a file may ask of an algorithm: numbers.  Not where it writes, nor what code it runs."""

if TYPE_CHECKING:
    Algorithm = str
else:
    Algorithm = Literal[ALGORITHMS]

Seed = Annotated[int, Meta(ge=0, le=2**32 - 1)]
Count = Annotated[int, Meta(ge=0, le=10**15)]
Score = Annotated[float, Meta(le=1e15)]
"""Of a row; -inf where none was built."""
Seconds = Annotated[float, Meta(ge=0, le=1e15)]
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


class PolicyDocument(Document):
    """What is needed of policy.json."""

    reference_over_uniform: Annotated[
        float,
        Meta(gt=0, le=1000, description="speed that the policy is used to, over the uniform row's"),
    ]


class ProgressDocument(Document):
    """How far a training had come, in its checkpoint."""

    best: Score
    sampled: Score
    seconds: Seconds
    processor_seconds: Seconds
    reference: Score
    next_look: Count
    next_keep: Count
    curve: list[tuple[Score, ...]]
    clone_score: Score | None = None


def read_config(folder: Path) -> ConfigDocument:
    """Read the config.json of a run; ValueError, naming it, for anything else."""
    path = folder / "config.json"
    with naming(path):
        config = model_of(ConfigDocument, read_json(path))
        for key, value in config.preset.options.items():
            if key not in OPTIONS:
                raise ValueError(f"unknown key 'preset.options.{key}': allowed: {OPTIONS}")
            model_of(Option, value, f"preset.options.{key}")  # type: ignore[arg-type]
    return config


def read_reference(folder: Path) -> float:
    """Read the speed that the policy of a run is used to, over the uniform row's."""
    path = folder / "policy.json"
    with naming(path):
        return model_of(PolicyDocument, read_json(path)).reference_over_uniform


def require_columns(curve: list[tuple[float, ...]], columns: tuple[str, ...]) -> None:
    """Raise ValueError for a learning curve of other columns: of another version."""
    for row in curve:
        if len(row) != len(columns):
            raise ValueError(f"curve holds {list(row)}: expected {', '.join(columns)}")


def training_seconds(folder: Path) -> float:
    """Read how long the training of a policy took [s]; 0 where nobody wrote it down."""

    class Spent(Document):
        seconds: Annotated[float, Meta(ge=0, le=1e9)] = 0.0

    for name in ("summary.json", "policy.json"):
        path = folder / name
        if path.exists():
            with naming(path):
                return model_of(Spent, read_json(path)).seconds
    return 0.0


def is_family(folder: Path) -> bool:
    """Tell whether a folder holds what `agents.conditioned.training.teach` writes."""
    try:
        document: Any = read_json(folder / "config.json")
    except (ValueError, OSError):
        return False
    return isinstance(document, dict) and document.get("algorithm") == "family"
