"""Bokeh, entered here only: its models are typed as their descriptors, not as what they take; here they are ``Any``."""

from __future__ import annotations

from typing import Any

from bokeh import embed as _embed
from bokeh import models as _models
from bokeh import plotting as _plotting
from bokeh import resources as _resources

models: Any = _models
_figure: Any = _plotting.figure
_components: Any = _embed.components
_inline: Any = _resources.Resources


def empty_figure(**options: Any) -> Any:
    """Return a figure with nothing in it."""
    return _figure(**options)


def embedded(figures: dict[str, Any]) -> tuple[str, dict[str, str]]:
    """Return the script that draws ``figures``, and by name the element that each is drawn into."""
    return _components(figures)


def program() -> str:
    """Return Bokeh's own program as an element for the page's head, so that the page needs nothing from elsewhere."""
    return _inline(mode="inline", components=["bokeh"]).render_js()
