"""The scene-conditioned policy: trained on many scenes, a row for a new one in milliseconds.

It first plans how many gaps at the end will be as tight as the rules allow (the one thing in which
good rows differ by whole numbers), then places domino after domino. What it observes at each is the
scene (its features), the plan, and how far it has come; the wave itself follows from these, so that
it need not be observed. NumPy alone is enough to use it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from agents.base.arrays import read_arrays
from agents.conditioned.distribution import FEATURES, SceneFamily, numbers, require_kind
from domino_env.chain.layout import Layout
from domino_env.chain.wave import Wave
from domino_env.scenes.files.reading import load_scene
from domino_env.scenes.scene import Scene

Floats = NDArray[np.float64]
Single = NDArray[np.float32]
Layers = tuple[tuple[Single, Single], ...]

PLANS = 13  # 0 … 12 tight gaps
SCALES = (1.0, 2.0, 4.0, 8.0, 16.0)  # [dominoes] over which the ends of a row make themselves felt
SHOWN = len(FEATURES) + 5 + 2 * len(SCALES)  # numbers shown to the policy at a domino
SHIPPED = Path(__file__).parents[1] / "policies" / "family" / "policy.npz"
LARGEST = 1e3  # weight that is believed: with larger ones sums might overflow
_FAMILY = SceneFamily()


@dataclass(frozen=True, eq=False)
class Designer:
    """The weights of a policy: layers of tanh with a linear one on top, (out, in) and (out,) each.

    Attributes
    ----------
    row
        From the observation at a domino to the logarithm of the gap over the height.
    plan
        From the scene to a preference for each plan.
    """

    row: Layers
    plan: Layers

    def gaps(self, scene: Scene, plans: Floats) -> Floats:
        """Lay the rows (K, N-1) [m] that K plans lead to."""
        features = numbers(scene)
        pairs = scene.count - 1
        wanted = _through(self.row, shown(features, plans)).reshape(len(plans), pairs)
        tight = np.arange(pairs) >= pairs - plans[:, None]
        gaps = np.where(tight, scene.spacing[0], scene.height * np.exp(np.minimum(wanted, 1.0)))
        return np.clip(gaps, *scene.spacing)

    def ranked(self, scene: Scene) -> NDArray[np.intp]:
        """Rank the plans for a scene, the preferred one first."""
        values = _through(self.plan, scene_shown(numbers(scene))[None])[0]
        return np.argsort(-values[: plans_of(scene.count)], kind="stable")


def plans_of(count: int) -> int:
    """Count the plans there are for a row of `count` dominoes: at most half of it is tight."""
    return min(PLANS, count // 2)


def scene_shown(features: Floats) -> Floats:
    """Scale a scene's features (…, 6) for a network: about -1 to 1."""
    low, high = _ends()
    values = np.asarray(features, dtype=np.float64).copy()
    values[..., 1:5] = np.log(values[..., 1:5])
    return np.asarray(2.0 * (values - low) / (high - low) - 1.0)


@lru_cache(maxsize=1)
def _ends() -> tuple[Floats, Floats]:
    f = _FAMILY
    ranges = np.array([f.friction, f.push, f.count, f.least, f.largest, f.thickness], np.float64)
    ranges[1:5] = np.log(ranges[1:5])
    return ranges[:, 0], ranges[:, 1]


def shown(features: Floats, plans: Floats) -> Floats:
    """Make the observations at each gap under each of K plans, (K (N-1), SHOWN)."""
    pairs = int(features[2]) - 1
    k = np.asarray(plans, dtype=np.float64)
    at = np.broadcast_to(np.arange(pairs, dtype=np.float64), (len(k), pairs))
    left = np.maximum(pairs - 1 - k[:, None] - at, 0.0)  # gaps before the tight ones begin
    parts = np.empty((len(k), pairs, SHOWN))
    parts[..., : len(FEATURES)] = scene_shown(features)
    c = len(FEATURES)
    parts[..., c] = 2.0 * at / (pairs - 1) - 1.0
    parts[..., c + 1], parts[..., c + 2] = np.log1p(at) / 2.0 - 1.0, np.log1p(left) / 2.0 - 1.0
    parts[..., c + 3], parts[..., c + 4] = k[:, None] / 6.0 - 1.0, np.exp(-k / 2.0)[:, None]
    for j, scale in enumerate(SCALES):
        parts[..., c + 5 + 2 * j] = np.exp(-at / scale)
        parts[..., c + 6 + 2 * j] = np.exp(-left / scale)
    return parts.reshape(-1, SHOWN)


def _through(layers: Layers, values: Floats) -> Floats:
    single = values.astype(np.float32)
    with _controller().limit(limits=1, user_api="blas"):  # so small products only wait for threads
        for weight, bias in layers[:-1]:
            single = np.tanh(single @ weight.T + bias)
        weight, bias = layers[-1]
        return (single @ weight.T + bias).astype(np.float64)


@lru_cache(maxsize=1)
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


# designing ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Design:
    """A row designed for a scene.

    Attributes
    ----------
    scene
        What it was designed for.
    layout
        The row.
    wave
        Its wave, simulated closely.
    score
        What the scene gives for it.
    plan
        Tight gaps planned at the end.
    seconds
        Time that the design took, its simulation included.
    outside
        In what the scene lies beyond those of the training; empty if in nothing.
    """

    scene: Scene
    layout: Layout
    wave: Wave
    score: float
    plan: int
    seconds: float
    outside: tuple[str, ...]


def design(
    scene: str | Path | Scene, *, tries: int = PLANS, designer: Designer | None = None
) -> Design:
    """Design a row for a scene, without search: the policy lays a row for each of a few plans.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    tries
        Plans that are laid and simulated, those that it prefers; the best is kept. 1 for the
        preferred one, untried.
    designer
        The policy; None for the one that ships.

    Raises
    ------
    ValueError
        For a scene that asks for something else than fast rows of equal dominoes.
    """
    if tries < 1:
        raise ValueError(f"tries = {tries}: give 1 or more")
    judged = scene if isinstance(scene, Scene) else load_scene(scene)
    require_kind(judged)
    policy = designer or shipped_designer()
    began = time.perf_counter()
    plans = policy.ranked(judged)[:tries].astype(np.float64)
    gaps = policy.gaps(judged, plans)
    best = 0 if len(plans) == 1 else int(np.argmax(judged.score_batch(gaps, None)))
    layout = judged.layout(gaps[best])
    wave = judged.simulate(layout)
    score = judged.score_wave(wave)
    seconds = time.perf_counter() - began
    outside = _FAMILY.outside(judged)
    return Design(judged, layout, wave, score, int(plans[best]), seconds, outside)


def acting(
    scene: Scene, plan: int | None = None, designer: Designer | None = None
) -> Callable[[Single], Single]:
    """Wrap the policy as one that acts in `DominoChain` of this scene, domino by domino.

    It goes by how many dominoes are placed, wherever the row began; what has been placed before is
    left as it is.

    Parameters
    ----------
    scene
        What is built.
    plan
        Tight gaps at the end; None for the policy's own choice.
    designer
        The policy; None for the one that ships.

    Returns
    -------
    callable
        Maps an observation of the environment to an action.

    Raises
    ------
    ValueError
        For a plan that a row of the scene cannot have, and for a scene as `design` refuses.
    """
    from domino_env.envs.observation import progress_features

    require_kind(scene)
    policy = designer or shipped_designer()
    chosen = int(policy.ranked(scene)[0]) if plan is None else plan
    if not 0 <= chosen < plans_of(scene.count):
        raise ValueError(f"plan = {chosen}: choose 0 to {plans_of(scene.count) - 1} tight gaps")
    gaps = policy.gaps(scene, np.array([float(chosen)]))[0]
    low, high = scene.spacing
    actions = (2.0 * (gaps - low) / (high - low) - 1.0).astype(np.float32)[:, None]
    part = progress_features(2).shape[1]  # the first of the last entries: the part of the row

    def act(seen: Single) -> Single:
        return np.asarray(actions[round(float(seen[-part]) * (scene.count - 1))])

    return act


# weights ------------------------------------------------------------------------------------------


@lru_cache(maxsize=1)
def shipped_designer() -> Designer:
    """Load the policy that comes with the package."""
    return load_designer(SHIPPED)


def load_designer(path: Path) -> Designer:
    """Read the weights that `arrays_of` gave names to; nothing in the file is run.

    Raises
    ------
    ValueError
        Where they are no such weights: names, shapes, or values that are not finite.
    """
    try:
        read = read_arrays(path)
        arrays = {name: np.asarray(array, dtype=np.float32) for name, array in read.items()}
        row, plan = (_layers(arrays, name) for name in ("row", "plan"))
        if 2 * (len(row) + len(plan)) != len(arrays):
            raise ValueError("arrays of other names")
        _require_chain("row", row, SHOWN, 1)
        _require_chain("plan", plan, len(FEATURES), PLANS)
    except (ValueError, KeyError) as error:
        raise ValueError(f"{path} does not hold the weights of a designer: {error}") from None
    return Designer(row, plan)


def arrays_of(designer: Designer) -> dict[str, Single]:
    """Name the weights, for a file."""
    return {
        f"{part}_{i}_{name}": array
        for part, layers in (("row", designer.row), ("plan", designer.plan))
        for i, layer in enumerate(layers)
        for name, array in zip(("weight", "bias"), layer, strict=True)
    }


def _layers(arrays: dict[str, Single], part: str) -> Layers:
    number = sum(name.startswith(f"{part}_") for name in arrays) // 2
    names = [(f"{part}_{i}_weight", f"{part}_{i}_bias") for i in range(number)]
    return tuple((arrays[weight], arrays[bias]) for weight, bias in names)


def _require_chain(part: str, layers: Layers, first: int, last: int) -> None:
    size = first
    for i, (weight, bias) in enumerate(layers):
        if weight.ndim != 2 or weight.shape[1] != size or bias.shape != weight.shape[:1]:
            raise ValueError(f"layer {i} of '{part}' has shapes {weight.shape} and {bias.shape}")
        if not all(np.all(np.abs(array) <= LARGEST) for array in (weight, bias)):
            raise ValueError(f"layer {i} of '{part}' holds values beyond ±{LARGEST:g}")
        size = weight.shape[0]
    if not layers or size != last:
        raise ValueError(f"'{part}' ends in {size} numbers, not {last}")
