"""What other programs and older silos rely on, as files: every message, every file that stays, every word of the help.

`python -m tests.golden` writes `tests/data/golden` anew. A change that moves or renames code leaves it as it is; one
that adds a field with a default adds to it; anything else there breaks somebody: see `silo/rpc/versions.py`.
"""
