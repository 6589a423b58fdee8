"""`silo excite`: a parameter or an input moves around its value for a while, until a key ends it."""

import contextlib
import signal
import sys
import termios
import time
import tty
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from silo.cli.codes import EXIT_FAILED
from silo.cli.common import ask_first
from silo.cli.verbs import verb
from silo.core.tuning.excitation import OVER, ends_of, excitation_of, number_at
from silo.core.tuning.parameters import Wave, value_text
from silo.polling import readable
from silo.printing import drawing

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.parameters.requests import ExcitationState

_ENDS = (signal.SIGTERM, signal.SIGHUP)  # of its terminal, or whoever runs it: it ends as by Ctrl-C


@verb(None, "excite", "NAME", short="Move a parameter around its value, to measure.")
@click.option("--chirp", metavar="FROM-TO", help="A sine whose frequency rises: 0.1-20Hz.")
@click.option("--multisine", metavar="FROM-TO", help="Sines of many frequencies at once: 0.1-20Hz.")
@click.option("--prbs", metavar="RATE", help="Jumps between both ends, decided anew so often: 50Hz.")
@click.option("--step", is_flag=True, help="One jump; negative amplitudes go down.")
@click.option("--amplitude", type=float, required=True, help="To both sides, in the unit of the parameter.")
@click.option("--for", "lasting", required=True, metavar="TIME", help="How long: 20s, 2min.")
@click.option("--ramp", metavar="TIME", help="In which it rises and falls; up to 1s, of a step 0 if not given.")
@click.option("-y", "--yes", is_flag=True, help="Don't ask.")
def excite(
    client: "Client", name: str, step: bool, amplitude: float, lasting: str, ramp: str | None, yes: bool, **waves: Any
) -> None:
    """Move a parameter, or an input of the program, around its value for a while; any key ends it.

    It stays within the bounds, or is refused as a whole, and comes back to the value before: at its end, and at once
    after a key, Ctrl-C, the end of this command or of the link, a limit that fires, or a change of somebody else, who
    has the last word. Its numbers are an event; `silo bode` and `silo step` tell what came of it. Exit code 1 if
    something else than a key here ended it before its time.

    \b
    Examples:
      silo excite anymal tau_offset --chirp 0.1-20Hz --amplitude 2 --for 20s
      silo excite anymal kp --step --amplitude 5 --for 3s --yes
      silo excite 'tau_offset[3]' --multisine 0.5-40Hz --amplitude 1 --for 60s
    """
    given = [(wave, words) for wave in Wave if (words := waves.get(wave.value, "" if step else None)) is not None]
    if len(given) != 1:
        raise click.UsageError("say one of --chirp 0.1-20Hz, --multisine 0.1-20Hz, --prbs 50Hz, --step")
    what = excitation_of(name, *given[0], amplitude, lasting, ramp)
    info = client.parameters.info(what.name)
    low, high = (number_at(end, what.index) for end in ends_of(info, what))
    around = value_text(number_at(info.value, what.index), info.unit)
    click.echo(f"{name} around {around}, from {low:g} to {high:g}: {what.text}")
    divider = next((one.options.divider for one in client.table().elements if one.name == info.name), 1)
    if divider > 1:
        click.echo(f"it is logged every {divider} ticks: for `silo bode` set its divider to 1 before (`silo set`)")
    if not yes:
        ask_first("begin?", "say --yes to begin without being asked; nothing was changed")
    for number in _ENDS:
        signal.signal(number, signal.default_int_handler)
    keyed = False
    with _keys() as keyboard:
        if keyboard:
            click.echo("any key ends it")

        def wait(state: "ExcitationState", seconds: float) -> bool:
            nonlocal keyed
            if not keyboard:
                time.sleep(seconds)
                return False
            click.echo(f"\r{state.at_s:6.1f} of {what.duration_s:g} s ", nl=False, file=drawing(sys.stdout))
            keyed = _key_within(seconds)
            return keyed

        ended = client.parameters.excite(
            name, what.wave, amplitude=what.amplitude, duration=what.duration_s, low_hz=what.low_hz,
            high_hz=what.high_hz, ramp=what.ramp_s, wait=wait,
        )  # fmt: skip
        if keyboard:
            click.echo("")
    click.echo(f"{name}: {ended.ended or 'it goes back'}; rows {ended.tick} to {ended.until}")
    if not keyed and ended.ended != OVER:
        click.get_current_context().exit(EXIT_FAILED)


def _key_within(seconds: float) -> bool:
    """Whether a key is pressed within so many seconds, or Ctrl-C."""
    try:
        if not readable(sys.stdin.fileno(), timeout_s=seconds):
            return False
    except KeyboardInterrupt:
        return True
    termios.tcflush(sys.stdin, termios.TCIFLUSH)
    return True


@contextlib.contextmanager
def _keys() -> Iterator[bool]:
    """Have single keys told while this goes on; yields whether there is a keyboard."""
    if not sys.stdin.isatty():
        yield False
        return
    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    try:
        yield True
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
