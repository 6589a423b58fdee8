"""`silo.gymnasium`: an environment of Gymnasium that logs itself, a file per episode."""

import os
from typing import TYPE_CHECKING, Any

from silo.core.arguments import INT64, whole
from silo.core.calls import told
from silo.errors import SourceError

if TYPE_CHECKING:
    from silo.simulators.episodes import LoggedEnvironment


@told("silo.gymnasium")
def gymnasium(
    env: Any,
    folder: str | os.PathLike[str] = ".",
    *,
    name: str = "",
    frequency: float | str | None = None,
    every: int = 1,
) -> "LoggedEnvironment":
    """Wrap an environment of Gymnasium so that each of its episodes becomes a file.

    Logged are `observation`, `action`, `reward`, `terminated` and `truncated`, a tick per step; spaces made of others
    (`Dict`, `Tuple`) become namespaces. An episode is saved as `<name>_episode_<number>.silo` when the next `reset()`
    or `close()` ends it. Time stamps are those of the simulation. `env.log` is the logger: variables of your own are
    added before the first `reset()`, and `env.log.serve()` shows it to silo-tui.

    >>> env = silo.gymnasium(gymnasium.make("Pendulum-v1"), folder="runs")  # doctest: +SKIP

    Args:
        env: a `gymnasium.Env`. Of a vector of environments each is wrapped by itself, by a name of its own.
        folder: where the files go; it is made if it isn't there. Numbers go on behind those of files that are there.
        name: of the logger; that of the environment's specification if not given.
        frequency: steps per second of the simulation (Hz); `1 / env.unwrapped.dt` if not given, else the frames per
            second of its metadata, else 1.
        every: how many episodes go by from one that is logged to the next; a file costs some ms.

    Returns:
        The environment, as a `gymnasium.Wrapper`.

    Raises:
        SourceError: it is no `gymnasium.Env`, or nothing in its spaces can be logged.
        ElementError: a number out of range.
    """
    from gymnasium import Env

    if not isinstance(env, Env):
        raise SourceError(
            f"silo.gymnasium takes an environment of gymnasium.make(...), got a {type(env).__name__}; wrap each part "
            "of a vector of environments by itself: lambda: silo.gymnasium(gymnasium.make(...), name='env_3')"
        )
    from silo.simulators.episodes import LoggedEnvironment

    return LoggedEnvironment(env, folder, name, frequency, whole("every", every, 1, INT64[1]))
