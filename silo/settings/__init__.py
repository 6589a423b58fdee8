"""How elements are logged, as people write it: the YAML script and typed words, their ranges and their texts.

Every way in (program, script, shell, `silo-tui`, wire) asks here, so that a rule and its message stand once. Knows no
logger, no process and no screen.
"""
