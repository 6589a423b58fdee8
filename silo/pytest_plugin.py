"""For tests of robot programs: the fixtures `silo_log`, `silo_runs`. pytest loads it wherever silo is installed."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    import os

    from silo.logger.logger import Logger
    from silo.run_index.runs import RunList


@pytest.fixture
def silo_log(request: pytest.FixtureRequest, tmp_path: Path) -> "Iterator[Logger]":
    """A `silo.Logger` by the name of the test, in its `tmp_path`; what it logged is saved when the test ends.

    Where the test fails, pytest's report shows the path of the file.
    """
    from silo.logger.logger import Logger

    name = re.sub(r"\W", "_", request.node.name)[:40]
    with Logger(name, folder=tmp_path, script=tmp_path / "logger.yaml") as log:
        yield log


class JudgedRuns:
    """What the fixture `silo_runs` gives: logs of folders, and their judgement."""

    def __call__(self, *folders: "str | os.PathLike[str]", where: str = "") -> "RunList":
        """Return the runs in folders, as `silo.runs` does."""
        from silo.run_index.runs import runs

        return runs(*folders, where=where)

    def check(
        self,
        run: "str | os.PathLike[str]",
        rules: "str | os.PathLike[str] | None" = None,
        against: "str | os.PathLike[str] | None" = None,
    ) -> None:
        """Fail the test where a run breaks rules, or is worse than a good one: `silo check --rules --against`.

        Args:
            run: a log.
            rules: a YAML file, as `silo check --rules` takes it.
            against: a log that was good: nothing may be newly missing, beyond a limit, lost.

        Raises:
            AssertionError: something is violated, or nothing could be judged; the message names each.
            SiloError: a log or the rules can't be read.
        """
        from silo.analysis.opening import open_log
        from silo.guards.guard import guard, words
        from silo.guards.rules import read_rules

        held = [] if rules is None else read_rules(Path(rules))
        baseline = None if against is None else open_log(against).recording
        found = guard(open_log(run).recording, held, baseline)
        wrong = [f"{one.what}: {words(one)}" for one in found if one.violated]
        blind = [f"{one.what} can't be told: {one.why}" for one in found if one.worst == "UNOBSERVABLE"]
        if wrong or len(blind) == len(found):
            raise AssertionError("\n".join([f"{run}: {len(wrong)} of {len(found)} violated", *wrong, *blind]))


@pytest.fixture
def silo_runs() -> JudgedRuns:
    """Runs for tests: `silo_runs("logs")` lists them, `silo_runs.check(run, rules, against)` judges one."""
    return JudgedRuns()
