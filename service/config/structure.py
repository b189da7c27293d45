"""The shape of the configuration, walked: which section lies at which place, and which keys it has.

One walk serves the errors (which keys would have been right here?) and the reference page.
"""

from __future__ import annotations

from typing import Any, get_args, get_origin

from service.config.section import Section


def sections(annotation: Any) -> list[type[Section]]:
    """Return the section types that an annotation holds: itself, of its tuple, of its union."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return [annotation]
    if get_origin(annotation) is None:
        return []
    return [section for argument in get_args(annotation) for section in sections(argument)]


def is_array(annotation: Any) -> bool:
    """Tell whether a field is an array of tables (``[[link]]``) rather than one table."""
    return get_origin(annotation) is tuple and bool(sections(annotation))


def kind_of(section: type[Section]) -> str | None:
    """Return the one value of ``kind`` that chooses this section in a union, or None."""
    field = section.model_fields.get("kind")
    values: tuple[Any, ...] = get_args(field.annotation) if field else ()
    return str(values[0]) if len(values) == 1 else None


def at(root: type[Section], place: tuple[int | str, ...]) -> type[Section] | None:
    """Return the section type at a pydantic location (keys, indices, union tags), or None."""
    section: type[Section] = root
    candidates: list[type[Section]] = []
    for step in place:
        if isinstance(step, int):
            continue
        chosen = [candidate for candidate in candidates if kind_of(candidate) == step]
        if len(candidates) > 1 and chosen:
            section, candidates = chosen[0], []
            continue
        field = section.model_fields.get(step)
        candidates = sections(field.annotation) if field else []
        if len(candidates) == 1:
            section, candidates = candidates[0], []
        elif not candidates:
            return None
    return section
