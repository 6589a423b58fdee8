"""Triggers, limits and derived signals of the present run: what is asked of them, how they stand, who judges them.

The helper process judges every row once and remembers what it knows for its successor. The rules are those of
`silo/judging/`; what triggers capture is copied and written in `captures/`.
"""
