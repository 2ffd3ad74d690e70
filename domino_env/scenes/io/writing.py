"""Documents written as TOML."""

from __future__ import annotations

import json
from typing import Any


def text_of(document: dict[str, Any]) -> str:
    """Write the text of a document: values before tables, and tables of tables in a line."""
    lines = []
    for key, value in sorted(document.items(), key=lambda item: isinstance(item[1], dict)):
        if isinstance(value, dict):
            told = (f"{k} = {_toml(v)}" for k, v in value.items() if v is not None)
            lines += ["", f"[{key}]", *told]
        else:
            lines.append(f"{key} = {_toml(value)}")
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{k} = {_toml(v)}' for k, v in value.items())}}}"
    return repr(float(value) if isinstance(value, float) else int(value))
