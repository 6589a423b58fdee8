"""What the control program imports: the logger, its element table, its life cycle, its end of the link.

Nothing slow happens here while it logs: publishing, answering and saving live in `silo/helper/`. Imported by the public
names of `silo` and by `silo/programs/`; never by `silo/helper/` or clients, which only see messages.
"""
