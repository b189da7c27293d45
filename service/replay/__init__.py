"""Replay: recordings through the estimator that the daemon runs, with figures, tables and CSV files out."""

from service.replay.bars import run_with_bars
from service.replay.command import command
from service.replay.run import Plan, Run, replay
from service.replay.seeds import replay_seeds, summary
from service.replay.table import show

__all__ = ["Plan", "Run", "command", "replay", "replay_seeds", "run_with_bars", "show", "summary"]
