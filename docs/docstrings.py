"""Docstrings on the site: what names an argument or a field becomes a line of a list.

This project's docstrings name them at the beginning of a line, as in "steps: dominoes to place";
Markdown would run such lines together.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

NAME = r"[a-zA-Z_]\w*(?: ?[\[(][^\])]*[\])])?"  # with a unit or arguments
NAMED = re.compile(rf"^({NAME}(?:(?:, |/| … ){NAME})*): ?(?=\S|$)")
SENTENCE = re.compile(r"(?<=[.;])  (?=[a-z_]+(?:, [a-z_]+)*: )")
NO_NAMES = {"Source", "Sources", "Raises", "http", "https"}


def listed(text: str) -> str:
    """A docstring whose lines "name: meaning" are a Markdown list."""
    lines: list[str] = []
    inside = fenced = False
    for line in text.splitlines():
        if line.startswith("```"):
            fenced = not fenced
        # in the middle of a sentence such a line names nothing
        begins = inside or not lines or not lines[-1] or lines[-1].endswith((".", ":"))
        found = NAMED.match(line) if begins and not fenced else None
        if found and found[1] not in NO_NAMES:
            if not inside and lines and lines[-1]:
                lines.append("")
            for k, part in enumerate(SENTENCE.split(line)):
                name, _, meaning = part.partition(":")
                lines.append(f"- `{name}`: {meaning.strip()}" if k or found else part)
            inside = True
        elif inside and line.startswith("    "):
            lines.append("  " + line.strip())
        else:
            if inside and line:
                lines.append("")
            inside = False
            lines.append(line)
    return "\n".join(lines)


class NamedLines(griffe.Extension):
    """Applies `listed` to every docstring of the packages."""

    def on_object(self, *, obj: Any, **_: Any) -> None:
        """Called by the collector for each module, class, function and attribute."""
        if obj.docstring is not None:
            obj.docstring.value = listed(obj.docstring.value)
