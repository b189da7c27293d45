"""Replay: recordings through the estimator that the daemon runs, with figures, tables and CSV files out."""

from service.replay.command import command, run_with_bars, show
from service.replay.run import Plan, Run, replay
from service.replay.seeds import replay_seeds, summary

__all__ = ["Plan", "Run", "command", "replay", "replay_seeds", "run_with_bars", "show", "summary"]
