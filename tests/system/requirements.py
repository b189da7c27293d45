"""Print the project's dependencies and theirs, pinned to what is installed here: the guest gets the same."""

from __future__ import annotations

import sys
from importlib.metadata import PackageNotFoundError, distribution

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

PROJECT = "beliefd"


def closure(name: str, pinned: dict[str, str]) -> dict[str, str]:
    """Add what ``name`` requires, without extras, to ``pinned`` (name to version)."""
    for text in distribution(name).requires or []:
        requirement = Requirement(text)
        required = canonicalize_name(requirement.name)
        if required in pinned or (requirement.marker and not requirement.marker.evaluate({"extra": ""})):
            continue
        try:
            pinned[required] = distribution(required).version
        except PackageNotFoundError:
            continue  # optional after all: the environment here does without
        closure(required, pinned)
    return pinned


if __name__ == "__main__":
    for package, version in sorted(closure(PROJECT, {}).items()):
        sys.stdout.write(f"{package}=={version}\n")
