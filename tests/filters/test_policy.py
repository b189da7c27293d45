"""When to resample: the rules, alone and composed."""

from __future__ import annotations

import pytest

from filters.policy import Always, EffectiveShare, Never, Wear, WhenStill


def test_never_and_always() -> None:
    for wear in (Wear(100, 1.0), Wear(100, 100.0, still=1.0)):
        assert not Never().due(wear)
        assert Always().due(wear)


def test_the_threshold_follows_the_count() -> None:
    """60 effective particles are worn of 200 and not of 100: nothing is remembered of an earlier count."""
    rule = EffectiveShare(0.5)
    assert rule.due(Wear(200, 60.0))
    assert not rule.due(Wear(100, 60.0))
    assert rule.due(Wear(200, 60.0))
    assert not rule.due(Wear(120, 60.0))  # below, not at


def test_another_rule_while_it_stands_still() -> None:
    rule = WhenStill(still=EffectiveShare(0.1), moving=EffectiveShare(0.5), certainty=0.8)
    worn, spent = Wear(100, 30.0), Wear(100, 5.0)
    assert rule.due(worn)
    assert rule.due(worn._replace(still=0.79))
    assert not rule.due(worn._replace(still=0.8))
    assert rule.due(spent._replace(still=1.0))
    assert not WhenStill(Never(), Always()).due(spent._replace(still=1.0))


@pytest.mark.parametrize("share", [0.0, 1.1, float("nan")])
def test_shares_are_shares(share: float) -> None:
    with pytest.raises(ValueError, match="below"):
        EffectiveShare(share)
    with pytest.raises(ValueError, match="certainty"):
        WhenStill(Never(), Always(), share)
