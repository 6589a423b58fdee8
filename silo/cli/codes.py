"""With which codes commands end. Each number means one thing, whatever the command."""

EXIT_FAILED, EXIT_USAGE, EXIT_NO_LOGGER, EXIT_FOUND, EXIT_BLIND = 1, 2, 3, 4, 5
EXIT_INTERRUPTED, EXIT_PIPE = 130, 141

EXIT_CODES = {  # the table of the reference
    0: "done, and nothing was found that is wrong",
    EXIT_FAILED: "it failed, was refused, or something can't be read; of a glob: for one of them",
    EXIT_USAGE: "the command line makes no sense",
    EXIT_NO_LOGGER: "no such logger, or nobody there answers",
    EXIT_FOUND: "it looked, and found something: beyond its limits (`silo alarms`, `silo check`), not whole "
    "(`silo verify`), not as archived (`silo archive --check`), or different (`silo diff`, `silo compare`, "
    "`silo param diff`, `silo script diff --exit-code`), or to be looked at (`silo script check`)",
    EXIT_BLIND: "it looked, and could not judge: some limits are blind (`silo alarms`), or all is (`silo check`, "
    "`silo compare`); what could be judged is well",
    EXIT_INTERRUPTED: "Ctrl-C",
    EXIT_PIPE: "who read the output has gone",
}
