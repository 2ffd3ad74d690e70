"""Rows as differentiable functions of the actions that build them, in PyTorch.

The same arithmetic as `domino_env.kernels.choice`, for all pairs at once where a rule does not tie
them together.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import torch

from domino_env import Scene


class Rows(NamedTuple):
    """Gaps, thicknesses and heights of dominoes 1 … N-1 of R rows, (R, N-1) each [m]."""

    spacing: torch.Tensor
    thickness: torch.Tensor
    height: torch.Tensor


def require_smooth(scene: Scene) -> None:
    """Raise ValueError for a scene whose rows are no smooth function of actions."""
    lists = (scene.spacing_values, scene.thickness_values, scene.stock)
    if any(rule is not None for rule in lists):
        raise ValueError(
            f"scene '{scene.name}' has lists, steps or a stock, whose values jump: apg follows the "
            "slope of a row, and there is none; leave them out, or choose ppo"
        )


def lay(scenes: Sequence[Scene], actions: torch.Tensor) -> Rows:
    """Lay the rows that actions build.

    Parameters
    ----------
    scenes
        What each of R rows is built for; of one kind, with the same things left free and asked for.
    actions
        (R, P, A) for P pairs, those of the longest row: beyond the end of a shorter one they count
        for nothing, and so does what is laid there.
    """
    like, pairs = scenes[0], actions.shape[1]
    gap_low, gap_high = _bounds([scene.spacing for scene in scenes])
    thick_low, thick_high = _bounds([scene.thickness for scene in scenes])
    behind = _column([scene.height for scene in scenes])
    rest = _column([scene.length or 0.0 for scene in scenes])
    ends = _column([scene.count - 2.0 for scene in scenes])
    tied = like.length is not None or like.largest_change is not None or like.growth is not None
    laid = list[tuple[torch.Tensor, ...]]()
    for n in range(pairs) if tied else (0,):
        action = actions[:, n : n + 1] if tied else actions
        same = torch.zeros_like(action[..., 0])
        growth = same + 1.0
        if like.growth is not None:
            growth = same + like.growth[0]
            if like.free_height:
                growth = _between(action[..., -1], *_bounds([like.growth]))
        ahead = behind * growth
        # where a length is asked for, the rest must stay within reach of the pairs to come
        after = torch.clamp(ends - n, min=0.0)
        least = rest - after * (gap_high + thick_high)
        most = rest - after * (gap_low + thick_low)
        thick = thick_low + same
        if like.free_thickness:
            low, high = thick_low, thick_high
            if like.length is not None:
                low, high = _reachable(low, high, least - gap_high, most - gap_low)
            thick = _between(action[..., int(like.free_spacing)], low, high)
        gap = gap_low + same
        if like.free_spacing:
            low, high = gap_low, gap_high
            if like.length is not None:
                low, high = _reachable(low, high, least - thick, most - thick)
            if like.largest_change is not None and n > 0:
                low = torch.maximum(low, laid[-1][0] - like.largest_change)
                high = torch.minimum(high, laid[-1][0] + like.largest_change)
            gap = _between(action[..., 0], low, high)
        if like.in_heights:
            gap, thick = gap * torch.minimum(behind, ahead), thick * ahead
        laid.append((gap, thick, ahead))
        rest, behind = rest - gap - thick, ahead
    return Rows(*(torch.cat(parts, dim=1) for parts in zip(*laid, strict=True)))


def _column(values: list[float]) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)[:, None]


def _bounds(bounds: list[tuple[float, float]]) -> tuple[torch.Tensor, torch.Tensor]:
    return _column([low for low, _ in bounds]), _column([high for _, high in bounds])


class _Inside(torch.autograd.Function):
    """Cut off at -1 and 1; what is beyond is moved by a loss that wants it back inside."""

    @staticmethod
    def forward(ctx: Any, action: torch.Tensor) -> torch.Tensor:
        ctx.save_for_backward(action)
        return action.clamp(-1.0, 1.0)

    @staticmethod
    def backward(ctx: Any, slope: torch.Tensor) -> torch.Tensor:
        (action,) = ctx.saved_tensors
        outwards = (action.abs() > 1.0) & (action * slope < 0.0)
        return torch.where(outwards, torch.zeros_like(slope), slope)


def _between(action: torch.Tensor, low: torch.Tensor, high: torch.Tensor) -> torch.Tensor:
    """What actions stand for; beyond [-1, 1], the nearer bound."""
    inside: torch.Tensor = _Inside.apply(action)  # type: ignore[no-untyped-call]
    return low + 0.5 * (inside + 1.0) * (high - low)


def _reachable(
    low: torch.Tensor, high: torch.Tensor, least: torch.Tensor, most: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """[low, high] narrowed to [least, most]; a single value where rounding leaves none."""
    new_low, new_high = torch.maximum(low, least), torch.minimum(high, most)
    middle = torch.minimum(torch.maximum(0.5 * (least + most), low), high)
    none = new_low > new_high
    return torch.where(none, middle, new_low), torch.where(none, middle, new_high)
