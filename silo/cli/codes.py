"""With which codes commands end. Each number means one thing, whatever the command."""

EXIT_FAILED = 1  # of commands that judge: something was beyond its limits
EXIT_USAGE = 2  # of commands that judge: what they need can't be read, too
EXIT_NO_LOGGER = 3
EXIT_DIFFERENT = 4
EXIT_BLIND = 5  # some of it, or all, could not be judged
EXIT_INTERRUPTED, EXIT_PIPE = 130, 141
