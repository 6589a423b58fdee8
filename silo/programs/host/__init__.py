"""`silo host`: logs this computer through silo; of use beside any robot program, and real data to try silo with.

`probes.py` says what is read, `program.py` is the loop.
"""
