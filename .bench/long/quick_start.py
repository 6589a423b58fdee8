"""What becomes of the first ticks of a run: `python .bench/long/quick_start.py [--times 20]`.

A served robot program starts its logger and logs some 80 ticks as fast as it can, or the first few; then it calls
`save()`, or an exception ends it, or a `kill -9` takes it, alone or in its very first ticks. Every tick was committed,
so all of them must stand in a file when the helper process is done. A recording that isn't saved, but of which the user
is told, counts as announced. Exits with 1 if any was lost, also if it was announced.
"""

import argparse
import subprocess
import sys
from dataclasses import dataclass

from processes import ROBOT, end_process, gone, show, wait_until, workplace
from robot import Case
from truth import RUN_FIRST, SAID, look, new_page

ENDS = {
    "save() after 80 quick ticks": ["start", "ticks 80", "save silo", "close"],
    "an exception after 80 quick ticks": ["start", "ticks 80", "raise"],
    "an exception after the first tick": ["start", "ticks 1", "raise"],
    "kill -9 after 80 quick ticks": ["start", "ticks 80", "kill"],
    "kill -9 after the first tick": ["start", "ticks 1", "kill"],
    "save() after a restart and 80 ticks": ["start", "ticks 80", "restart", "ticks 80", "save silo", "close"],
    "kill -9 after a restart and 80 ticks": ["start", "ticks 80", "restart", "ticks 80", "kill"],
}
HELPER_S = 40.0


@dataclass(frozen=True)
class Outcome:
    """Whether all ticks stand in a file, and whether something was said where they don't."""

    saved: bool
    said: bool
    text: str


def perform(steps: list[str]) -> Outcome:
    """One robot program with these steps."""
    with workplace() as (folder, environment):
        page = new_page(folder / "page")
        case = Case(name="quick", folder=str(folder / "logs"), page=str(folder / "page"), steps=["serve", *steps])
        said = folder / "said.txt"
        with said.open("w") as file:
            command = [sys.executable, str(ROBOT), case.text]
            robot = subprocess.Popen(command, env=environment, stdout=file, stderr=subprocess.STDOUT)
        helper = 0

        def born() -> bool:
            nonlocal helper
            words = said.read_text().split()
            helper = int(words[words.index("helper") + 1]) if "helper" in words[:-1] else 0
            return bool(helper) or robot.poll() is not None

        wait_until(born, HELPER_S, 0.01)
        robot.wait()
        if helper:
            # `saved` is told on the console by a helper that had something to save; the others end at once
            wait_until(lambda: gone(helper) or "ended without close" in said.read_text(), HELPER_S, 0.02)
            end_process(helper)
        text = said.read_text()
        ends = [look(path, 1, case.size, int(page[RUN_FIRST])) for path in (folder / "logs").glob("*.silo")]
        whole = any(found.last >= int(page[SAID]) - 1 and not found.torn and not found.missing for found in ends)
        told = "refused" in text or "could not be saved" in text or "silo recover" in text
        return Outcome(whole, told, text)


def main() -> int:
    """Try each end several times; 1 if ticks were lost."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=20, help="robot programs per end")
    parser.add_argument("--verbose", action="store_true", help="what was said where ticks are lost")
    options = parser.parse_args()
    rows: list[tuple[str, ...]] = [("end", "tries", "saved", "not saved, told", "not saved, without a word")]
    lost = 0
    for name, steps in ENDS.items():
        outcomes = [perform(steps) for _ in range(options.times)]
        missing = [outcome for outcome in outcomes if not outcome.saved]
        lost += len(missing)
        silent = sum(not outcome.said for outcome in missing)
        figures = (len(outcomes), len(outcomes) - len(missing), len(missing) - silent, silent)
        rows.append((name, *map(str, figures)))
        if options.verbose:
            for outcome in missing:
                print(f"{name}: {outcome.text}", flush=True)
    show(rows)
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
