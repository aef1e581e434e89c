"""Suites of graded starts, the outcomes of policies on them, and policies behind a server.

from scenegen.suites import Suite, run_suite
suite = Suite.load("suite/")
run_suite(suite, "outcomes.jsonl", world="table", policy="my_policy.py:Policy")
"""

from scenegen.learn.success.files import OutcomesHeader
from scenegen.play.policy_server import serve
from scenegen.play.suites.new import new_suite
from scenegen.play.suites.outcomes import EpisodeOutcome, SuiteOutcomes, dump_outcomes, read_outcomes
from scenegen.play.suites.report import report_suite
from scenegen.play.suites.run import run_suite
from scenegen.play.suites.suite import GradedStart, Suite, SuiteTask, check_suite

__all__ = [
    "EpisodeOutcome",
    "GradedStart",
    "OutcomesHeader",
    "Suite",
    "SuiteOutcomes",
    "SuiteTask",
    "check_suite",
    "dump_outcomes",
    "new_suite",
    "read_outcomes",
    "report_suite",
    "run_suite",
    "serve",
]
