"""What the keys mean: the string below each, read from the source when somebody asks.

pydantic would read them (``use_attribute_docstrings``) at every start of every process, for which they are no use.
"""

from __future__ import annotations

import ast
import inspect
import sys
from functools import cache

from service.config.section import Section


def description(section: type[Section], key: str) -> str:
    """Return what stands below a key in its section or in the one that it comes from; nothing if nothing does."""
    for origin in section.__mro__:
        if key in vars(origin).get("__annotations__", {}):
            return _descriptions(origin.__module__).get((origin.__name__, key), "")
    return ""


@cache
def _descriptions(module: str) -> dict[tuple[str, str], str]:
    """Return the strings below the annotated names of a module's classes, by class and name."""
    found: dict[tuple[str, str], str] = {}
    for section in ast.parse(inspect.getsource(sys.modules[module])).body:
        if not isinstance(section, ast.ClassDef):
            continue
        for statement, below in zip(section.body, section.body[1:], strict=False):
            match statement, below:
                case (
                    ast.AnnAssign(target=ast.Name(id=key)),
                    ast.Expr(value=ast.Constant(value=str(text))),
                ):
                    found[section.name, key] = inspect.cleandoc(text)
                case _:
                    pass
    return found
