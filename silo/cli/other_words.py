"""Words that people take for commands, and what to write; loaded where a command isn't there."""

import os
from collections.abc import Sequence

from silo.core.names import did_you_mean, nearest

_INSTEAD = {
    "`silo --help`, and `silo COMMAND --help`": "help man usage commands",
    "`silo --version`": "version",
    "`silo ls` lists the loggers that run, `silo runs` the saved ones": "list loggers ps nodes discover logs",
    "`silo info LOGGER|FILE`": "show status describe signals elements topics state head",
    "`silo-tui LOGGER|FILE`": "open view tui ui gui web edit monitor top",
    "`silo watch LOGGER [NAME]` prints live values, `silo stats FILE` and `silo plot FILE NAME` look at saved ones":
        "cat echo tail print values value get read dump topic subscribe play replay history mean",
    "`silo set LOGGER NAME enabled=on`, or divider=5, size=10s": "enable disable divider configure",
    "`silo stop LOGGER`; the program itself ends by Ctrl-C": "pause kill quit end finish",
    "`silo start LOGGER`": "run begin resume launch",
    "`silo save LOGGER --type csv` of one that runs, `silo convert FILE OUT.csv` of a file": "export csv bag write",
    "`silo files ls LOGGER`, `silo files fetch LOGGER NAME`, `silo files rm LOGGER NAME`":
        "download fetch recordings rm delete remove get_file",
    "`silo script load LOGGER FILE`": "load apply",
    "`silo trigger add LOGGER NAME 'WHEN'`": "capture on when",
    "`silo check FILE --limit NAME=-40,-30,30,40`; log.limit(...) in a program": "limit limits alarm",
    "`silo trigger test LOGGER 'WHEN'` tells when; `/` in the plots of silo-tui goes there": "find where search",
    "`silo mark LOGGER 'TEXT'`": "event log annotate note_tick",
    "`silo remote add NAME ENDPOINT|FILE`; then `silo ls` has its loggers": "connect ssh login robots host_add",
    "`silo remote doctor NAME`": "doctor ping test diagnose",
    "`silo control take LOGGER`": "lock take",
    "`silo query 'SQL'`": "sql select",
    "`silo address LOGGER [NAME]`": "url key",
    "log.serve() in the program": "serve server init create new",
    "`pip install --upgrade` of the package that you installed": "update upgrade install",
}  # fmt: skip
OTHER_WORDS = {word: way for way, words in _INSTEAD.items() for word in words.split()}


def what_instead(words: Sequence[str], commands: Sequence[str]) -> str:
    """Return what is said behind a first word that is no command: what does it, or what was meant."""
    word = words[0]
    if word in OTHER_WORDS:
        return f"; it is {OTHER_WORDS[word]}"
    if os.path.exists(word):  # noqa: PTH110
        return f"; of a file it is `silo info {word}`, `silo plot {word} NAME`, `silo-tui {word}`"
    if len(words) > 1 and words[1] in commands:
        return f"; the command comes first: `silo {words[1]} {word}`"
    return did_you_mean(nearest(word, commands), "`silo --help` lists them")
