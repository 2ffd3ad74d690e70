"""What the judges saw, as tables of a page."""

from __future__ import annotations

from domino_env.core.tables import markdown_table
from domino_env.rigid.judges import in_words
from domino_env.rigid.known import OnFloor, Seen, Verified


def floors_table(found: dict[str, Verified]) -> list[str]:
    """Tabulate in Markdown what is left of every gain, hinged and on each floor."""
    one = next(iter(found.values()), None)
    if one is None:
        return []
    names = ["scene"] + [in_words(look.floor) for look in one.floors]
    rows = [[_called(name, told), *map(_cell, told.floors)] for name, told in found.items()]
    return markdown_table(names, rows)


def hinged_table(found: dict[str, Verified]) -> list[str]:
    """Tabulate the hinged rows, best and uniform, beside the model."""
    rows = []
    for name, told in found.items():
        for kind, seen, verdict in (
            ("best", told.hinged.best, told.verdict),
            ("uniform", told.hinged.uniform, told.uniform_verdict),
        ):
            rows.append((f"{_called(name, told)}, {kind}", *hinged_cells(seen), why(verdict)))
    return markdown_table(HINGED, rows)


HINGED = ("row", "last hit", "largest of any hit", "in doubt", "verdict")


def hinged_cells(seen: Seen) -> tuple[str, str, str]:
    """How far a hinged row is from the model: last hit, largest, the judge's own doubt."""
    return share(seen.last), f"{seen.largest:.3%}", share(seen.doubt, sign="")


def engine_table(found: dict[str, Verified]) -> list[str]:
    """Tabulate how far the rigid-body engine is from the built-in simulator on each floor."""
    asked = {name: told for name, told in found.items() if told.engine}
    if not asked:
        return []
    one = next(iter(asked.values()))
    names = ["scene"] + [in_words(look.floor) for look in one.floors]
    rows = [[_called(name, told), *map(_apart, told.floors)] for name, told in asked.items()]
    return markdown_table(names, rows)


def why(verdict: str) -> str:
    """Cut a verdict to its first word and its reason, for a cell."""
    word, _, rest = verdict.partition(":")
    _, found, reason = rest.partition("Why: ")
    return f"{word.lower()}: {reason.rstrip('.')}" if found else word.lower()


def share(value: float | None, sign: str = "+") -> str:
    """Write a part in per cent."""
    return "never" if value is None else f"{value:{sign}.3%}"


def _called(name: str, told: Verified) -> str:
    first = "" if told.first == told.count else f" (first {told.first} of {told.count})"
    return f"`{name}`{first}"


def _cell(look: OnFloor) -> str:
    """One scene on one floor: the gain, then both rows, and what stays up."""
    lead = "" if look.gain is None else f"**{look.gain:+.2%}** "
    return f"{lead}{_row(look.best)} / {_row(look.uniform)}"


def _row(seen: Seen) -> str:
    return seen.score + (f" ({seen.staying_up} stay up)" if seen.staying_up else "")


def _apart(look: OnFloor) -> str:
    if look.engine is None:
        return ""
    if look.engine.last is None or look.best.last is None:
        return "never hit"
    apart = (1.0 + look.engine.last) / (1.0 + look.best.last) - 1.0
    doubt = None
    if look.engine.doubt is not None and look.best.doubt is not None:
        doubt = look.engine.doubt + look.best.doubt
    sure = "not converged" if doubt is None else f"± {doubt:.2%}"
    return f"{apart:+.3%} ({sure})"
