"""Some of every kind, evenly spaced, the newest among them."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from service.estimator.thinning import spaced


def test_evenly_spaced_of_one_kind_with_the_newest() -> None:
    assert sorted(spaced(["a"] * 12, 3)) == [3, 7, 11]


def test_a_rare_kind_is_not_crowded_out() -> None:
    assert 2 in spaced(["a", "a", "b", *["a"] * 20], 4)


@settings(deadline=None)
@given(st.lists(st.sampled_from("abcd"), min_size=1, max_size=100), st.integers(1, 120))
def test_as_many_as_may_be_and_of_every_kind(names: list[str], most: int) -> None:
    """None twice; min(most, all) of them; every kind if there is room; shares that differ by what there was only."""
    taken = spaced(names, most)
    assert len(set(taken)) == len(taken) == min(most, len(names))
    kinds = set(names)
    counts = {kind: sum(names[place] == kind for place in taken) for kind in kinds}
    if most >= len(kinds):
        assert min(counts.values()) >= 1
    for kind in kinds:
        newest = max(place for place, name in enumerate(names) if name == kind)
        assert counts[kind] == 0 or newest in taken
        assert counts[kind] == names.count(kind) or counts[kind] >= max(counts.values()) - 1
