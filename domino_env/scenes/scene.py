"""Scene: a design problem, its file and its uniform baseline."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

from domino_env.core.types import Floats
from domino_env.physics.wave import Wave
from domino_env.scenes.consistency import check_document
from domino_env.scenes.scene_base import SceneBase
from domino_env.scenes.tables import format_toml, make_document
from domino_env.scenes.uniform import UniformBaseline, stored_point, uniform_baseline


@dataclass(frozen=True, kw_only=True)
class Scene(SceneBase):
    """Design problem: dominoes, allowed values, objective.

    Scenes are equal if all their fields are equal. A scene made in Python has the defaults of a
    scene file and is checked like one; `count`, `spacing`, and either `thickness` or `stock` are
    required.

    Parameters
    ----------
    name
        Name of the scene and of its run folders.
    title
        Subject in one line; by default the name.
    objective
        Scoring rule, one of `domino_env.scenes.objectives.OBJECTIVES`.
    physics
        Friction, gravity, push.
    count
        Number of dominoes N.
    height
        Height of every domino, or of the first if heights grow [m].
    width
        Width of every domino [m].
    density
        Density of every domino [kg/m³].
    first_thickness
        Thickness of domino 0, which is not a design variable [m]; by default that of the others,
        if the scene fixes it.
    spacing
        Least and largest free gap [m]; equal if the scene fixes it. If `in_heights`, in heights of
        the shorter of the two dominoes at the gap.
    thickness
        Least and largest thickness of dominoes 1 … N-1 [m]; equal if the scene fixes it. If
        `in_heights`, in heights of the domino itself. With a stock, those of its pieces.
    length
        Distance from the first to the last pivot [m], with a tolerance of 1e-9 m; None if it is
        free.
    stock
        Stock from which all dominoes are taken, the first one included; None for no stock.
    growth
        Least and largest ratio of a height to the one before, both 1 or more; None if all heights
        are equal.
    in_heights
        True if `spacing` and `thickness` are given in heights of a domino.
    limits
        Smallest allowed stall margin; None for no limit.
    settings
        Table of the objective: a `Tempo` for "tempo"; None for others.
    floor_friction
        Coulomb coefficient of the floor of free-standing dominoes, 0 or more. Scores are then
        computed from the speeds of `domino_env.simulate_standing`, and a success needs all dominoes
        to topple. None for fixed pivots, as in the analytic model.
    ground
        Ground on which layouts stand, a slope or a curve; None for flat ground.
    placement
        Placement noise: normal errors of all designed gaps in every episode of an environment and,
        with draws, in scores; a gap with its error is at least 0.2 mm. None for no noise.
    run_out
        Dominoes with fixed gaps after the `count` dominoes that are designed. Waves, scores and
        pictures are those of the whole row; layouts have the designed dominoes only. None for none.

    Raises
    ------
    TypeError
        For physics that are no `Physics`, and for `in_heights` other than True or False.
    ValueError
        For a value out of its range, and for fields that contradict each other; the message has
        key, value and accepted range.

    Examples
    --------
    >>> import domino_env as de
    >>> scene = de.Scene(count=60, spacing=(0.002, 0.040), thickness=(0.0075, 0.0075))
    >>> round(scene.uniform().score, 3)
    0.833
    """

    uniform_point: tuple[float, float] | None = field(
        default=None, init=False, compare=False, repr=False
    )
    """`best_point` of the scene, see `with_uniform`; None if it is not known."""

    def __post_init__(self) -> None:
        try:
            self._set(check_document(self.document()).fields())
        except ValueError as error:
            raise ValueError(f"scene '{self.name}': {error}") from None

    def _set(self, fields: dict[str, Any]) -> None:
        """Set fields while the scene is made."""
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Self:
        """Return the scene of a file's document, which has a name.

        Parameters
        ----------
        document
            Tables of the file, as `tomllib` reads them.

        Returns
        -------
        Scene
            The scene.

        Raises
        ------
        ValueError
            For an invalid document; the message has key, value and accepted range.
        """
        scene = object.__new__(cls)
        scene._set({"uniform_point": None} | check_document(document).fields())
        return scene

    def document(self) -> dict[str, Any]:
        """Return the tables of the file that is read as the same scene.

        Returns
        -------
        dict
            Values by table and key, in the units of scene files.
        """
        return make_document(self)

    def to_toml(self) -> str:
        """Return the text of the scene's file.

        Returns
        -------
        str
            TOML that `load_scene` reads as the same scene.
        """
        return format_toml(self.document())

    def uniform(self) -> UniformBaseline:
        """Return the best layout with equal gaps, computed once for equal scenes.

        Returns
        -------
        UniformBaseline
            The baseline, with its `layout`, `wave` and `score`.
        """
        return self._uniform

    @cached_property
    def _uniform(self) -> UniformBaseline:
        return uniform_baseline(self, self.uniform_point or stored_point(self.document()))

    def with_uniform(self, point: Floats | Sequence[float]) -> Self:
        """Return the same scene with a given uniform baseline.

        Parameters
        ----------
        point
            (2,) result of `best_point`.

        Returns
        -------
        Scene
            The scene.
        """
        scene = copy.copy(self)  # without the checks, which the fields have passed
        vars(scene).pop("_uniform", None)
        scene._set({"uniform_point": tuple(map(float, point))})
        return scene

    def format_with_gain(self, score: float, wave: Wave) -> str:
        """Format a score with its unit, and compare it with the uniform baseline.

        Parameters
        ----------
        score
            A score of the scene.
        wave
            The wave that has this score.

        Returns
        -------
        str
            Text such as "0.828550 m/s, 3.18% over uniform", with a schedule of hits such as
            "RMS error 1.42904 ms, 18.73 ms with uniform".
        """
        comparison = self.criterion.compare(score, self.uniform().score, "uniform")
        return ", ".join(filter(None, (self.format_score(score, wave), comparison)))
