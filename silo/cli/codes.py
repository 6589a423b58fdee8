"""With which codes commands end. Each number means one thing, whatever the command."""

EXIT_FAILED, EXIT_USAGE, EXIT_NO_LOGGER, EXIT_DIFFERENT, EXIT_BLIND = 1, 2, 3, 4, 5
EXIT_INTERRUPTED, EXIT_PIPE = 130, 141

EXIT_CODES = {  # the table of the reference
    0: "done; of `silo alarms` and `silo check`: nothing was beyond its limits",
    EXIT_FAILED: "it failed, or was refused; of a glob: one of them; of `silo alarms` and `silo check`: something was "
    "beyond its limits; of `silo verify` and `silo archive`: something is not whole, or not in the archive",
    EXIT_USAGE: "the command line makes no sense; of `silo check`: the file or an expression can't be read, too",
    EXIT_NO_LOGGER: "no such logger, or nobody there answers",
    EXIT_DIFFERENT: "they differ (`silo diff`, `silo compare`, `silo param diff`, `silo script diff --exit-code`)",
    EXIT_BLIND: "some limits are blind (`silo alarms`), or nothing could be judged (`silo check`), and nothing was "
    "beyond the others",
    EXIT_INTERRUPTED: "Ctrl-C",
    EXIT_PIPE: "who read the output has gone",
}
