"""Parts of a recording while they are written.

Their layout, their manifest, and how they are closed or gone on with.
"""
