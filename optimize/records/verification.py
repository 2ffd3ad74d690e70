"""The records checked: each best row known beside the best uniform row, hinged and on floors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from domino_env.core.threads import allowed_threads
from domino_env.physics.forces import diagnose
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave, simulate
from domino_env.rigid.built_in import Standing
from domino_env.rigid.comparison import Verification, last_difference
from domino_env.rigid.judges import Fall, Judge, largest_move
from domino_env.rigid.known import OnFloor, Seen, Verified, digest
from domino_env.rigid.uniform import best_uniform_on
from domino_env.scenes.baseline import gain
from domino_env.scenes.scene import Scene
from optimize.experiments.best_known import BestKnown

FIRST = 100  # dominoes of a long row that are looked at
LOOSE, CLOSE = 1e-3, 2e-4  # relative error asked of the judge, in the search and of what is kept


def verify_records(
    records: dict[str, BestKnown],
    scenes: dict[str, Scene],
    floors: Sequence[float],
    engine: Judge | None = None,
    report: Callable[[str], None] = print,
) -> dict[str, Verified]:
    """Topple every row hinged and on every floor, side by side on all cores.

    Parameters
    ----------
    records
        The best rows known, by the names of their scenes.
    scenes
        These scenes.
    floors
        Friction of each.
    engine
        Somebody else's, asked for the best rows besides; None for nobody's.
    report
        Called with a line when a row is done.
    """
    places = (None, *floors)
    pool = ThreadPoolExecutor(allowed_threads())
    try:
        jobs = {
            (name, floor): pool.submit(_look, scenes[name], record.layout, floor, engine)
            for name, record in records.items()
            for floor in places
        }
        found = {}
        for name, record in records.items():
            looks = [jobs[name, floor].result() for floor in places]
            found[name] = _verified(scenes[name], record.layout, looks, engine)
            report(f"{name}: {found[name].verdict}")
    finally:
        pool.shutdown(cancel_futures=True)
    return found


@dataclass(frozen=True, eq=False)
class _Look:
    """Both rows on one floor."""

    best: Fall
    row: Layout
    uniform: Fall
    engine: Fall | None


def _look(scene: Scene, layout: Layout, floor: float | None, engine: Judge | None) -> _Look:
    judge, physics = Standing(CLOSE), scene.physics
    row, mark = first_of(layout), first_of(scene.uniform().layout)
    chosen = best_uniform_on(scene, mark, floor, Standing(LOOSE))
    rows = [chosen] if chosen is mark else [chosen, mark]  # the search looked less closely
    falls = [judge.fall(one, physics, floor) for one in rows]
    slow = [fall.arrivals[-1] / one.length for one, fall in zip(rows, falls, strict=True)]
    k = int(np.argmin(slow))
    return _Look(
        best=judge.fall(row, physics, floor),
        row=rows[k],
        uniform=falls[k],
        engine=None if engine is None else engine.fall(row, physics, floor),
    )


def first_of(layout: Layout, count: int = FIRST) -> Layout:
    """Return the first dominoes of a row; the row itself where it has no more."""
    if layout.count <= count:
        return layout
    return Layout(
        layout.spacing[: count - 1], layout.thickness[:count], layout.height[:count], layout.width,
        layout.density[:count], layout.rise[: count - 1], layout.tilt[:count],
    )  # fmt: skip


def _verified(scene: Scene, layout: Layout, looks: list[_Look], engine: Judge | None) -> Verified:
    row, judge = first_of(layout), Standing(CLOSE)
    wave, mark = simulate(row, scene.physics), simulate(looks[0].row, scene.physics)
    checked = Verification(wave, judge.name, looks[0].best, ())
    uniform = Verification(mark, judge.name, looks[0].uniform, ())
    return Verified(
        digest=digest(layout, scene.physics),
        count=layout.count,
        first=row.count,
        judge=judge.name,
        engine=None if engine is None else engine.name,
        floors=tuple(_on_floor(scene, wave, look) for look in looks),
        verdict=checked.verdict,
        uniform_verdict=uniform.verdict,
        flush_loss=wave.largest_flush_loss,
        stall_margin=float(np.nanmin(wave.stall_margin)),
        lifted=len(diagnose(row, scene.physics).lifted),
    )


def _on_floor(scene: Scene, wave: Wave, look: _Look) -> OnFloor:
    best = _seen(scene, wave, look.best)
    uniform = _seen(scene, simulate(look.row, scene.physics), look.uniform)
    return OnFloor(
        floor=look.best.floor,
        best=best,
        uniform=uniform,
        gap=float(look.row.spacing.mean()),
        gain=gain(best.speed or 0.0, uniform.speed or 0.0) if scene.unit == "m/s" else None,
        engine=None if look.engine is None else _seen(scene, wave, look.engine),
    )


def _seen(scene: Scene, wave: Wave, fall: Fall) -> Seen:
    last = last_difference(fall, wave)
    came = min(wave.hit, fall.hit)
    hit = bool(np.isfinite(fall.arrivals[-1]))
    speed = wave.layout.length / float(fall.arrivals[-1]) if hit else None
    return Seen(
        last=last if np.isfinite(last) else None,
        largest=largest_move(fall.arrivals[:came], wave.arrival_times[:came]),
        doubt=fall.doubt if np.isfinite(fall.doubt) else None,
        staying_up=fall.staying_up,
        speed=speed,
        score=_score(scene, wave, fall, speed),
    )


def _score(scene: Scene, wave: Wave, fall: Fall, speed: float | None) -> str:
    """What the row is worth as it fell; where drawn rows count too, the speed of this one."""
    if speed is None:
        return f"dies after {fall.hit} dominoes"
    if scene.unit == "m/s":
        return f"{speed:.4f} m/s"
    seen = replace(wave, arrival_times=fall.arrivals)
    return scene.in_words(scene.score(seen), seen)
