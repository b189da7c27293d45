"""Switches of ``[honesty]`` turned off for one run: ``--without trust``, to see what a mechanism is worth."""

from __future__ import annotations

from service.config import Configuration, Honesty


def unknown_switches(without: tuple[str, ...]) -> str:
    """Return what is wrong with the names of switches, in the user's words; nothing if they are all known."""
    wrong = [name for name in without if name not in Honesty.model_fields]
    if not wrong:
        return ""
    return f"--without {', '.join(wrong)}: [honesty] has {', '.join(Honesty.model_fields)}"


def switched_off(configuration: Configuration, without: tuple[str, ...]) -> Configuration:
    """Return ``configuration`` with these switches turned off."""
    honesty = configuration.honesty.model_copy(update=dict.fromkeys(without, False))
    return configuration.model_copy(update={"honesty": honesty})
